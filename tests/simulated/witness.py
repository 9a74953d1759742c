"""What must hold at every event, whatever the schedule does."""

from collections.abc import Callable
from typing import Any

import msgspec
from phototaxis.runtime import machine as m
from phototaxis.runtime.journal import GIVEN_UP
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
      By the clock, in real time, the newest command may also hold on.
    - A simulation that lives does not go back, and leaves out no tick.
    - What an agent finds in its journal are whole entries.

    Attributes
    ----------
    on_tick : is told each tick that the simulation asks for.
    author : whose command was applied last.
    published : the states, readings and commands, in the order in which they came.
    former : agents that are not started again once they are gone.
    learned : for each run that an agent has left, the last tick that it learned from.
    """

    def __init__(self) -> None:
        self.on_tick: Callable[[int], object] = lambda tick: None
        self.answers: dict[tuple[str, str, int, str], Any] = {}
        self.published: dict[str, list[Any]] = {"state": [], "readings": [], "command": []}
        self.learned: list[int] = []
        self.former: set[str] = set()
        self._kept: dict[str, tuple[str, int]] = {}
        self._states: dict[tuple[str, int], State] = {}
        self._newest: dict[str, tuple[str, int]] = {}
        self.author = ""

    def carried(self, process: Process, effect: m.Effect) -> None:
        """An effect has been carried out."""
        if process.role == "agent" and isinstance(effect, m.Append):
            readings = msgspec.msgpack.decode(effect.entry, type=Readings)
            self._kept[process.ident] = readings.run, readings.tick
        elif process.role == "agent" and isinstance(effect, m.Save):
            self._kept[process.ident] = effect.meta.run, effect.meta.tick
        elif isinstance(effect, m.Publish) and isinstance(effect.message, State):
            self._asked(process, msgspec.structs.replace(effect.message))
            self.on_tick(effect.message.tick)
        elif isinstance(effect, m.Publish) and effect.topic in ("readings", "command"):
            self._answered(process, effect.topic, effect.message)

    def _asked(self, process: Process, state: State) -> None:
        run, tick = self._newest.get(process.ident, (state.run, state.tick))
        if run == state.run and state.tick not in (tick, tick + 1):
            raise Broken(f"{process.ident} goes from tick {tick} to {state.tick}")
        self._newest[process.ident] = state.run, state.tick
        before, known = self._states.get((state.run, state.tick - 1)), self._states.get((state.run, state.tick))
        if known is not None and known.hash != state.hash:
            raise Broken(f"tick {state.tick} comes in two states")
        if known is None and before is not None and not _rightful(state, before):
            raise Broken(f"tick {state.tick} follows a command of {state.author}, but {before.driver} drove")
        self._states[state.run, state.tick] = state
        self.published["state"].append(state)
        self.author = state.author or self.author

    def _answered(self, process: Process, topic: str, message: Any) -> None:
        told = msgspec.structs.replace(message, driver="") if topic == "readings" else message
        who = "" if topic == "readings" else message.author
        if self.answers.setdefault((topic, message.run, message.tick, who), told) != told:
            raise Broken(f"{process.ident} answers tick {message.tick} in another way than before")
        self.published[topic].append(message)
        run, tick = self._kept.get(process.ident, ("", -1))
        if topic == "command" and (run != message.run or tick < message.tick):
            raise Broken(f"{process.ident} answers tick {message.tick} before it is in the journal")

    def restarted(self, ident: str, found: Kept) -> None:
        """A process goes on from what its former self left on disk."""
        try:
            entries = [msgspec.msgpack.decode(frame, type=Readings) for frame in found.frames[1:] if frame != GIVEN_UP]
        except msgspec.DecodeError:
            raise Broken(f"{ident} takes a part of an entry for a whole one") from None
        newest = entries[-1] if entries else None if found.checkpoint is None else found.checkpoint[0]
        if newest is not None:
            self._kept[ident] = newest.run, newest.tick


def _rightful(state: State, before: State) -> bool:
    """Whether the command that led to a state is of the driver, or is the one before that holds on by the clock."""
    holds = (state.left, state.right, state.author) == (before.left, before.right, before.author)
    return not state.author or state.author == before.driver or holds


def watch_learning(agent: Agent, witness: Witness) -> Agent:
    """The same agent, which breaks when it is made to go through a tick a second time."""

    class Watched(type(agent)):
        def __call__(self, readings: Readings):
            run, tick = self.tick
            if run == readings.run and readings.tick <= tick:
                raise Broken(f"{self.author} learns tick {readings.tick} again, after {tick}")
            if run not in ("", readings.run):
                witness.learned.append(tick)
            return super().__call__(readings)

    agent.__class__ = Watched
    return agent
