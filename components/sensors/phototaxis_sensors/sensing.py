"""The sensors' side of the step protocol: join the run whose state comes, then answer each of its states."""

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import msgspec
from phototaxis.runtime.machine import Answer, Ask, Effect, Event, Publish, Record, Refuse, Say, Stop
from phototaxis.runtime.protocol import AnswerCache
from phototaxis.runtime.transitions import Transitions
from phototaxis.wire.codec import Refused
from phototaxis.wire.messages import LogRequest, SimLog, World
from phototaxis.wire.topics import step_topics

from phototaxis_sensors.model import PastMoment
from phototaxis_sensors.suite import Suite


class Phase(StrEnum):
    """What the sensors are doing."""

    IDLE = "idle"
    JOINING = "joining"
    """They have asked for the world of a run whose state has come."""
    RECALLING = "recalling"
    """They have asked the simulation's log for the earlier ticks of the episode, which their models need."""
    SERVING = "serving"


class Input(StrEnum):
    """What may happen to them."""

    OURS = "state of our run"
    OTHER = "state of another run"
    WORLD = "world of that run"
    WORLD_FOR_MEMORY = "world of that run, models remember"
    NO_WORLD = "no such world"
    LOG = "log"


TABLE = {
    (Phase.IDLE, Input.OTHER): Phase.JOINING,
    (Phase.IDLE, Input.OURS): Phase.SERVING,
    (Phase.JOINING, Input.OTHER): Phase.JOINING,
    (Phase.JOINING, Input.OURS): Phase.SERVING,
    (Phase.JOINING, Input.NO_WORLD): Phase.IDLE,
    (Phase.JOINING, Input.WORLD): Phase.SERVING,
    (Phase.JOINING, Input.WORLD_FOR_MEMORY): Phase.RECALLING,
    (Phase.RECALLING, Input.OURS): Phase.RECALLING,
    (Phase.RECALLING, Input.OTHER): Phase.RECALLING,
    (Phase.RECALLING, Input.LOG): Phase.SERVING,
    (Phase.SERVING, Input.OURS): Phase.SERVING,
    (Phase.SERVING, Input.OTHER): Phase.JOINING,
}


class Place(NamedTuple):
    """What a state belongs to: one robot and many have topics of their own."""

    topic: str
    run: str


class Session:
    """The sensors in one run."""

    def __init__(self, world: World, suite: Suite[Any, Any]):
        self.suite, self.topics = suite, step_topics(world.robots)
        self.place = Place(self.topics.state, world.run)
        self.sense = AnswerCache[Any](suite)
        self.newest = -1
        """The newest tick that was answered."""


STATES = {step_topics(robots).state for robots in (1, 2)}


class Sensing:
    """Answers every state of whatever run is on the bus.

    A world that did not come is asked for again when the simulation repeats its state. The present session stays
    until the world of another run has come: a stray message of another run does not cost models their memory.

    Parameters
    ----------
    make : makes the suite of a world.
    """

    deadline = math.inf
    """The sensors have no deadline: they wait only for messages."""

    def __init__(self, make: Callable[[World], Suite[Any, Any]]):
        self._make = make
        self._phase = Transitions(TABLE, Phase.IDLE)
        self._session: Session | None = None
        self._wanted = Place("", "")
        """The run and topic of the waiting states."""
        self._waiting: dict[int, Any] = {}
        """The waiting states, by tick."""

    def on(self, event: Event, now: float) -> list[Effect]:
        """What follows from an event."""
        if event.topic in STATES:
            return self._asked(Place(event.topic, event.message.run), event.message)
        if event.topic == "answer":
            return self._answered(event.message)
        return [Stop()] if event.topic == "stop" else []

    def _asked(self, place: Place, state: Any) -> list[Effect]:
        """A state: the question of one tick."""
        session, before = self._session, self._phase.state
        if session is not None and session.place == place:
            if self._phase.take(Input.OURS) is Phase.SERVING:
                return self._sense(session, state)
        elif self._phase.take(Input.OTHER) is Phase.RECALLING:
            return []
        if place != self._wanted:
            self._wanted, self._waiting = place, {}
        self._waiting[state.tick] = state
        return [Ask("world", "world")] if before in (Phase.IDLE, Phase.SERVING) else []

    def _answered(self, answer: Answer) -> list[Effect]:
        """An answer to a question; one that came too late finds us in another phase."""
        if answer.tag == "world" and self._phase.state is Phase.JOINING:
            return self._join(answer.first)
        if answer.tag == "log/sim" and self._session is not None and self._phase.state is Phase.RECALLING:
            return self._recall(self._session, answer.messages)
        return []

    def _join(self, world: World | None) -> list[Effect]:
        if world is None or Place(step_topics(world.robots).state, world.run) != self._wanted:
            self._phase.take(Input.NO_WORLD)
            return []
        session = self._session = Session(world, self._make(world))
        said = Say(f"senses in the run {world.run}; robots: {world.robots}")
        if self._phase.take(Input.WORLD_FOR_MEMORY if session.suite.stateful else Input.WORLD) is Phase.RECALLING:
            return [said, Ask("log/sim", "log/sim", LogRequest(), every=True)]
        return [said, *self._sense(session, self._newest_waiting())]

    def _recall(self, session: Session, chunks: Sequence[SimLog]) -> list[Effect]:
        """Lead the models through the earlier ticks of the episode, and answer the newest state that waits."""
        suite, state = session.suite, self._newest_waiting()
        past = {tick: PastMoment(tick, one.episode, one.x, one.y, one.heading) for tick, one in self._waiting.items()}
        for chunk in chunks:
            if chunk.run == self._wanted.run:
                columns = zip(chunk.tick, chunk.episode, chunk.x, chunk.y, chunk.heading, strict=True)
                past.update({row[0]: PastMoment(*row) for row in columns})
        episode = [past[tick] for tick in sorted(past) if tick < state.tick and past[tick].episode == state.episode]
        for moment in episode:
            suite.follow(moment)
        began = episode[0].tick if episode else state.tick
        if began and (began - 1 not in past or past[began - 1].episode == state.episode):
            suite.begun_anew(began)
        self._phase.take(Input.LOG)
        return self._sense(session, state)

    def _newest_waiting(self) -> Any:
        return self._waiting[max(self._waiting)]

    def _sense(self, session: Session, state: Any) -> list[Effect]:
        """The answer to one state, the same whenever it is asked; nothing for a state that is over."""
        try:
            readings = session.sense(state)
        except Refused as why:
            return [Refuse(session.topics.state, str(why))]
        if readings is None:
            return []
        if readings.driver != state.driver:  # the seat may change while a tick is asked again
            readings = msgspec.structs.replace(readings, driver=state.driver)
        published = Publish(session.topics.readings, readings)
        if state.tick <= session.newest:
            return [published]
        session.newest = state.tick
        suite = session.suite
        return [published, Record((state.run, *suite.names), (state.tick, *suite.first(readings)))]
