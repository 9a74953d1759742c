"""What must hold at every event, whatever the schedule does."""

from collections.abc import Callable
from typing import Any

import msgspec
from phototaxis.runtime import machine as m
from phototaxis.wire.messages import Readings, State
from phototaxis_agent.agent import Agent
from phototaxis_agent.keeping import Kept

from simulated.process import Process


class Broken(AssertionError):
    """An invariant does not hold."""


class Witness:
    """Watches the effects of all processes.

    - The answer of a process to a tick never changes.
    - An agent that keeps a journal has written a tick down before it answers it.
    - An agent learns from each tick once, and in order.
    - A tick has one state, and the command that led to it is of the driver that was named last when it was asked for.
    - What an agent finds in its journal are whole entries.

    Attributes
    ----------
    on_tick : is told each tick that the simulation asks for.
    author : whose command was applied last.
    """

    def __init__(self) -> None:
        self.on_tick: Callable[[int], object] = lambda tick: None
        self.answers: dict[tuple[str, str, int, str], Any] = {}
        self._kept: dict[str, int] = {}
        self._states: dict[tuple[str, int], State] = {}
        self.author = ""

    def carried(self, process: Process, effect: m.Effect) -> None:
        """An effect has been carried out."""
        if process.role == "agent" and isinstance(effect, m.Append):
            self._kept[process.ident] = msgspec.msgpack.decode(effect.entry, type=Readings).tick
        elif process.role == "agent" and isinstance(effect, m.Save):
            self._kept[process.ident] = max(effect.meta.tick, self._kept.get(process.ident, -1))
        elif isinstance(effect, m.Publish) and isinstance(effect.message, State):
            self._asked(msgspec.structs.replace(effect.message))
            self.on_tick(effect.message.tick)
        elif isinstance(effect, m.Publish) and effect.topic in ("readings", "command"):
            self._answered(process, effect.topic, effect.message)

    def _asked(self, state: State) -> None:
        before, known = self._states.get((state.run, state.tick - 1)), self._states.get((state.run, state.tick))
        if known is not None and known.hash != state.hash:
            raise Broken(f"tick {state.tick} comes in two states")
        if known is None and state.author and before is not None and state.author != before.driver:
            raise Broken(f"tick {state.tick} follows a command of {state.author}, but {before.driver} drove")
        self._states[state.run, state.tick] = state
        self.author = state.author or self.author

    def _answered(self, process: Process, topic: str, message: Any) -> None:
        told = msgspec.structs.replace(message, driver="") if topic == "readings" else message
        who = "" if topic == "readings" else message.author
        if self.answers.setdefault((topic, message.run, message.tick, who), told) != told:
            raise Broken(f"{process.ident} answers tick {message.tick} in another way than before")
        if topic == "command" and self._kept.get(process.ident, -1) < message.tick:
            raise Broken(f"{process.ident} answers tick {message.tick} before it is in the journal")

    def restarted(self, ident: str, found: Kept) -> None:
        """A process goes on from what its former self left on disk."""
        try:
            ticks = [msgspec.msgpack.decode(frame, type=Readings).tick for frame in found.frames[1:]]
        except msgspec.DecodeError:
            raise Broken(f"{ident} takes a part of an entry for a whole one") from None
        self._kept[ident] = max([-1 if found.checkpoint is None else found.checkpoint[0].tick, *ticks])


def watch_learning(agent: Agent) -> Agent:
    """The same agent, which breaks when it is made to go through a tick a second time."""

    class Watched(type(agent)):
        def __call__(self, readings: Readings):
            run, tick = self.tick
            if run == readings.run and readings.tick <= tick:
                raise Broken(f"{self.author} learns tick {readings.tick} again, after {tick}")
            return super().__call__(readings)

    agent.__class__ = Watched
    return agent
