"""A readable trace of one schedule: when and where something happened, what it changed, and what followed."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from phototaxis.runtime import machine as m
from phototaxis.runtime.transitions import Transitions
from phototaxis.wire.messages import State

from simulated import process
from simulated.schedule import Fault
from simulated.shrink import one_line
from simulated.storm import Storm

STREAMS = ("state", "readings", "command", "status", "recording", "episode", "time")
QUIET = (m.Publish, m.Append, m.Record, m.Begin, m.Save, m.Flush)
"""Effects of a tick that goes as every other."""


class Trace:
    """Writes a line an event. Turns that change no state and do what every tick does are counted in one line."""

    def __init__(self, write: Callable[[str], object]):
        self._write = write
        self._quiet = 0
        self._tick = -1
        self._changes: list[str] = []
        self._effects: list[m.Effect] = []
        self._now: Callable[[], float] = lambda: 0.0

    @contextmanager
    def watching(self) -> Generator[None]:
        """Trace what happens meanwhile."""
        turn, take, begin, carry = process.Process._turn, Transitions.take, Storm._begin, process.Loop.carry
        kill, start = process.Process.kill, process.Process.start

        def turned(one: process.Process, event: m.Event) -> None:
            self._now = lambda: one.network.timeline.now
            outer, self._changes, self._effects = (self._changes, self._effects), [], []
            turn(one, event)
            self._line(one.ident, event)
            self._changes, self._effects = outer

        def taken(states: Transitions[Any, Any], given: Any) -> Any:
            before, after = states.state, take(states, given)
            if after != before:
                self._changes.append(f"{before} → {after}")
            return after

        def carried(loop: process.Loop, effect: m.Effect) -> None:
            self._effects.append(effect)
            carry(loop, effect)

        def begun(storm: Storm, fault: Fault) -> None:
            self._say("", f"=== {one_line(fault)}")
            begin(storm, fault)

        def killed(one: process.Process) -> None:
            if not one.dead:
                self._say(one.ident, "ends")
            kill(one)

        def started(one: process.Process, *given: Any, **more: Any) -> None:
            self._say(one.ident, "starts")
            start(one, *given, **more)

        replaced = {"_turn": turned, "kill": killed, "start": started}
        with (
            patch.multiple(process.Process, **replaced),
            patch.object(process.Loop, "carry", carried),
            patch.object(Transitions, "take", taken),
            patch.object(Storm, "_begin", begun),
        ):
            yield
        self._fold()

    def _line(self, who: str, event: m.Event) -> None:
        states = [one.message for one in self._effects if isinstance(one, m.Publish)]
        ticks = [state.tick for state in states if isinstance(state, State)]
        self._tick = max([self._tick, *ticks])
        if event is m.START and not self._changes:
            return
        if event.topic in STREAMS and not self._changes and all(isinstance(one, QUIET) for one in self._effects):
            self._quiet += 1
            return
        effects = ", ".join(filter(None, map(_effect, self._effects)))
        self._say(who, f"{_event(event):32} {'; '.join(self._changes):24} {effects}")

    def _say(self, who: str, what: str) -> None:
        self._fold()
        self._write(f"{self._now():9.4f} s  {who:12} {what}".rstrip())

    def _fold(self) -> None:
        if self._quiet:
            self._write(f"{'…':>11}  {self._quiet} quiet turns, to tick {self._tick}")
        self._quiet = 0


def _event(event: m.Event) -> str:
    return f"{event.topic} {_about(event.message)}".rstrip()


def _about(message: Any) -> str:
    """A message in a few words."""
    if isinstance(message, m.Answer):
        return f"{message.tag}: {_about(message.first) or 'nobody'}"
    if isinstance(message, tuple):
        return " ".join(map(str, message))
    words = [str(getattr(message, name)) for name in ("verb", "agent", "tick", "driver") if hasattr(message, name)]
    if reason := getattr(message, "reason", ""):
        words.append(reason)
    return " ".join(filter(None, words)) or ("" if message is None else type(message).__name__)


def _effect(effect: m.Effect) -> str:
    if isinstance(effect, m.Publish):
        return f"{effect.topic} {_about(effect.message)}"
    if isinstance(effect, m.Ask):
        return f"ask {effect.topic} {_about(effect.request)}".rstrip()
    if isinstance(effect, m.Refuse):
        return f"refuse {effect.topic}: {effect.why}"
    if isinstance(effect, m.Reply):
        return f"reply {_about(effect.message)}"
    if isinstance(effect, (m.Say, m.Warn)):
        return f"“{effect.text}”"
    return "" if isinstance(effect, (m.Record, m.Flush, m.Listen)) else type(effect).__name__.lower()
