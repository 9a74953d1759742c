"""The decisions of the recorder: which run to record, when to ask for missing chunks, and when all are there."""

import math
from collections.abc import Iterator
from enum import StrEnum
from itertools import count

from phototaxis.runtime.machine import Answer, Ask, Effect, Event, Own, Stop
from phototaxis.runtime.roles import ROLES
from phototaxis.runtime.transitions import Transitions
from phototaxis.wire.messages import World
from phototaxis.wire.topics import TOPICS

from phototaxis_recorder.reader import LogReader

KEEP_EVERY_S = 0.15
"""Seconds between two writes of the gathered chunks to disk."""
ASK_EVERY_S = 1.0
"""Seconds after which the recorder asks the writers of a silent or late topic for missed chunks."""
BEHIND_TICKS = 64
"""If a topic is more ticks than this behind the newest, the recorder asks for its chunks and no longer waits for it.

Zenoh may drop chunks for a long time after a link was congested."""
LOGS = tuple(topic.name for topic in TOPICS.values() if topic.kind == "log")


class Open(Own):
    """Begin the recording of a run."""

    world: World


class Note(Own):
    """Add a remark to the recording, at its newest tick."""

    text: str


class Keep(Own):
    """Flush the recording to disk."""


class Report(Own):
    """Publish the newest tick that is on disk."""


class Close(Own):
    """Complete the recording and close it."""


class Phase(StrEnum):
    """What the recorder is doing."""

    IDLE = "idle"
    JOINING = "joining"
    """The recorder has asked for the world; meanwhile it goes on recording the present run, if there is one."""
    RECORDING = "recording"
    COMPLETING = "completing"
    """The recorder knows the world of another run, and has asked all writers for the rest of the present one."""
    JOINING_TO_END = "joining to end"
    """The recorder must stop, but still waits for the world that it has asked for."""
    ENDING = "ending"
    """The recorder must stop, and has asked all writers for the rest of the run."""
    ENDED = "ended"


class Input(StrEnum):
    """What may happen to the recorder."""

    NEWS = "simulation or another run's chunk"
    WORLD = "world"
    OTHER_WORLD = "world of another run"
    NO_OTHER = "no other world"
    NO_WORLD = "no world"
    STOP = "stop"
    ALL = "all answers"


TABLE = {
    (Phase.IDLE, Input.NEWS): Phase.JOINING,
    (Phase.IDLE, Input.STOP): Phase.ENDING,
    (Phase.JOINING, Input.NEWS): Phase.JOINING,
    (Phase.JOINING, Input.NO_WORLD): Phase.IDLE,
    (Phase.JOINING, Input.WORLD): Phase.RECORDING,
    (Phase.JOINING, Input.OTHER_WORLD): Phase.COMPLETING,
    (Phase.JOINING, Input.NO_OTHER): Phase.RECORDING,
    (Phase.JOINING, Input.STOP): Phase.JOINING_TO_END,
    (Phase.RECORDING, Input.NEWS): Phase.JOINING,
    (Phase.RECORDING, Input.STOP): Phase.ENDING,
    (Phase.COMPLETING, Input.NEWS): Phase.COMPLETING,
    (Phase.COMPLETING, Input.ALL): Phase.RECORDING,
    (Phase.COMPLETING, Input.STOP): Phase.ENDING,
    (Phase.JOINING_TO_END, Input.NEWS): Phase.JOINING_TO_END,
    (Phase.JOINING_TO_END, Input.STOP): Phase.JOINING_TO_END,
    (Phase.JOINING_TO_END, Input.NO_WORLD): Phase.ENDING,
    (Phase.JOINING_TO_END, Input.WORLD): Phase.ENDING,
    (Phase.JOINING_TO_END, Input.OTHER_WORLD): Phase.ENDING,
    (Phase.JOINING_TO_END, Input.NO_OTHER): Phase.ENDING,
    (Phase.ENDING, Input.NEWS): Phase.ENDING,
    (Phase.ENDING, Input.STOP): Phase.ENDING,
    (Phase.ENDING, Input.ALL): Phase.ENDED,
}


class Gathering:
    """Gathers the logs of the runs on the bus into recordings, one for each run."""

    def __init__(self) -> None:
        self._phase = Transitions(TABLE, Phase.IDLE)
        self._run = ""
        """The run that is recorded; "" for none."""
        self._next: World | None = None
        """The world of another run, which is recorded next."""
        self._readers: dict[str, LogReader] = {}
        self._alive: set[str] = set()
        self._simulations: set[str] = set()
        self._tags = count()
        self._keep_at = self._ask_at = 0.0

    @property
    def deadline(self) -> float:
        """The time of the next flush to disk or the next question, in the clock of `now`."""
        if self._run:
            return min(self._keep_at, self._ask_at)
        return self._ask_at if self._simulations and self._phase.state is Phase.IDLE else math.inf

    def on(self, event: Event, now: float) -> list[Effect]:
        """Handle an event, and return what the recorder does about it."""
        before = self._phase.state
        effects = [*self._take(event, now), *self._due(now)]
        after = self._phase.state
        if after in (Phase.COMPLETING, Phase.ENDING):
            effects += self._complete(now, begin=before is not after)
        return effects

    def _take(self, event: Event, now: float) -> Iterator[Effect]:
        if event.topic in LOGS:
            if self._run and event.message.run == self._run:
                yield from self._readers[event.topic].came(event.message, now)
            else:
                yield from self._news()  # the recorder asks for this chunk again when that run's recording begins
        elif event.topic in ("alive", "gone"):
            yield from self._noticed(event.topic == "alive", *event.message)
        elif event.topic == "answer":
            yield from self._answered(event.message, now)
        elif event.topic == "stop":
            self._phase.take(Input.STOP)

    def _noticed(self, here: bool, role: str, ident: str) -> Iterator[Effect]:
        """Note that a component came or went; a simulation that comes may bring another run."""
        for known in (self._alive, self._simulations) if role == "sim" else (self._alive,):
            (known.add if here else known.discard)(ident)
        if self._run and role in ROLES and role != "observer":
            yield Note(text=f"{ident} {'is here' if here else 'is gone'}")
        if here and role == "sim":
            yield from self._news()

    def _news(self) -> Iterator[Effect]:
        """Ask for the world, since there may be another run."""
        if self._phase.state in (Phase.IDLE, Phase.RECORDING):
            yield Ask("world", "world")
        self._phase.take(Input.NEWS)

    def _answered(self, answer: Answer, now: float) -> Iterator[Effect]:
        if answer.tag == "world":
            if self._phase.state in (Phase.JOINING, Phase.JOINING_TO_END):
                yield from self._join(answer.first, now)
            return
        for reader in self._readers.values():
            if answer.tag in reader.open:
                yield from reader.answered(answer.tag, answer.messages)

    def _join(self, world: World | None, now: float) -> Iterator[Effect]:
        """Record the run of a world, unless it is the one that is recorded already."""
        if world is None or world.run == self._run:
            self._ask_at = self._ask_at if self._run else now + ASK_EVERY_S
            self._phase.take(Input.NO_OTHER if self._run else Input.NO_WORLD)
        elif self._run:
            self._next = world
            self._phase.take(Input.OTHER_WORLD)
        else:
            self._phase.take(Input.WORLD)
            yield self._open(world, now)

    def _open(self, world: World, now: float) -> Open:
        """Begin the recording of a run; `_ask_at` is now, so that all writers are asked at once for their chunks."""
        self._run, self._keep_at, self._ask_at = world.run, now + KEEP_EVERY_S, now
        self._readers = {topic: LogReader(topic, world.run, self._tags, self._alive) for topic in LOGS}
        return Open(world=world)

    def _due(self, now: float) -> Iterator[Effect]:
        """Do what is done at intervals: flush, report, and ask for missing chunks."""
        if self._run and now >= self._keep_at:
            self._keep_at = now + KEEP_EVERY_S
            yield Keep()
        if self._run and now >= self._ask_at:
            self._ask_at = now + ASK_EVERY_S
            yield Report()
            if self._phase.state in (Phase.JOINING, Phase.RECORDING):
                yield from self._ask_the_late(now)
        elif self._phase.state is Phase.IDLE and now >= self.deadline:
            yield from self._news()

    def _ask_the_late(self, now: float) -> Iterator[Effect]:
        newest = max(reader.newest for reader in self._readers.values())
        for reader in self._readers.values():
            late = newest - reader.newest > BEHIND_TICKS or now - reader.heard > ASK_EVERY_S
            if late and not reader.open:
                yield from reader.ask()

    def _complete(self, now: float, begin: bool) -> Iterator[Effect]:
        """Ask all writers for the rest of the run; when all answers are there, go to the next run or stop."""
        for reader in self._readers.values() if begin else ():
            yield from reader.ask()
        if any(reader.open for reader in self._readers.values()):
            return
        if self._run:
            yield Close()
        if self._phase.take(Input.ALL) is Phase.RECORDING and self._next is not None:
            yield self._open(self._next, now)
        else:
            yield Stop()
