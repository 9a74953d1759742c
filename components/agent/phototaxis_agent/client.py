"""The agent's side of the protocol, without bus, clock or disk: joins runs, answers ticks, follows, hands over."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any

from phototaxis.runtime.machine import Answer, Ask, Effect, Event, Flush, Publish, Refuse, Reply, Say, Stop
from phototaxis.runtime.seat_client import RELEASE, SEAT, Mode, Place, SeatClient, Seen
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.wire.codec import Refused
from phototaxis.wire.messages import BatchReadings, CheckpointRequest, Readings, World

from phototaxis_agent.answering import refuse_mode
from phototaxis_agent.following import bequest
from phototaxis_agent.keeping import Keeping, Kept, restored
from phototaxis_agent.rows import row
from phototaxis_agent.session import Session

MAX_WAITING = 20_000
"""Readings that wait for the answer to a question; the oldest are dropped first."""
WORLD = "world"


class AgentClient:
    """Lets an agent drive whatever run is on the bus.

    Readings that come while their run's world or a predecessor's state is asked for wait for the answer, in order.

    Parameters
    ----------
    ident : the agent's name on the bus.
    make : makes the agent once the world is known.
    kept : what is on disk; it is restored in the first run.
    keeps : whether checkpoints and a journal are wanted.
    mode, at : how the seat is sought, and from which tick on it is taken over.

    An agent that waits for the seat inherits from a driver of its own kind (the same learner and percept): a
    standby inherits at once and then keeps in step with the driver; a taker-over inherits when it gets the seat.
    Behind a driver of another kind, the agent learns from what that driver does.

    Raises
    ------
    UserError
        by `on`, for a world that cannot be joined in this way, a checkpoint that does not fit, or a learner that fails.
    """

    def __init__(
        self,
        ident: str,
        make: Callable[[World], SeatedAgent],
        kept: Kept = Kept(),  # noqa: B008 - cannot be changed
        keeps: bool = False,
        mode: Mode = "claim",
        at: int = 0,
    ):
        self.seat = SeatClient(ident, mode, at)
        self._make, self._kept, self._keeping = make, kept, Keeping(keeps, kept)
        self._session: Session | None = None
        self._waiting: deque[Readings | BatchReadings] = deque(maxlen=MAX_WAITING)
        self._asks_world = False

    def on(self, event: Event, now: float) -> list[Effect]:
        """What follows from an event."""
        if event.topic in ("readings", "batch/readings"):
            return self._readings(event.message, now)
        if event.topic == "answer":
            return self._answer(event.message, now)
        if event.topic == "checkpoint":
            return self._bequeath(event)
        if event.topic == "write_failure":
            return self._keeping.write_failure(event.message, self.agent, now)
        if event.topic == "time" and self._session is not None:
            return self._session.following.again(now)
        if event.topic == "alive" and event.message[0] == "sim":
            self.seat.simulation_is_back()
        return self._leave() if event.topic == "stop" else []

    @property
    def deadline(self) -> float:
        """When a question that may be lost is put once more."""
        return math.inf if self._session is None else self._session.following.again_at

    @property
    def agent(self) -> SeatedAgent | None:
        """The agent, once it has joined a run."""
        return None if self._session is None else self._session.agent

    def _readings(self, readings: Readings | BatchReadings, now: float) -> list[Effect]:
        """One tick: of a known run it is taken at once, unless a question that matters is out."""
        session = self._session
        if self.seat.place is Place.LEAVING:
            return []
        if session is None or readings.run != session.world.run:
            self._wait(readings)
            asked, self._asks_world = self._asks_world, True
            return [] if asked else [Ask(WORLD, "world")]
        if self._waits(session):
            self._wait(readings)
            return []
        return self._tick(session, readings, now) if isinstance(readings, session.kind) else []

    def _waits(self, session: Session) -> bool:
        """Whether readings wait for an answer: what is inherited decides what they are answered with."""
        following, place = session.following, self.seat.place
        return following.inherits or (following.probes and place not in (Place.IN_STEP, Place.DRIVING))

    def _wait(self, readings: Readings | BatchReadings) -> None:
        if not self._waiting or self._waiting[-1] != readings:
            self._waiting.append(readings)

    def _go_on(self, now: float) -> list[Effect]:
        """Take the readings of the present run that have waited; the simulation repeats what matters of others."""
        waiting = [one for one in self._waiting if self._session is not None and one.run == self._session.world.run]
        self._waiting.clear()
        return [effect for readings in waiting for effect in self._readings(readings, now)]

    def _tick(self, session: Session, readings: Readings | BatchReadings, now: float) -> list[Effect]:
        if self.seat.stale(readings):
            return []
        before, inherits = self.seat.place, self.seat.mode != "claim"
        effects = self.seat.see(readings, now)
        place = self.seat.place
        if place is Place.SUPERSEDED:
            return [*effects, *self._leave()]
        if place is Place.DRIVING:
            if before is place:
                return self._drive(session, readings, now)
            equal = not inherits or (before is Place.IN_STEP and not session.missed(readings))
            return self._sit(session, readings, now, equal)
        if before is Place.DRIVING:
            effects = [Flush(), *effects]
        if self.seat.mode != "claim" and readings.driver:
            fresh = session.following.see(readings)
            if session.answering.whole:
                effects += self._follow(session, readings, now, fresh)
        return effects

    def _sit(self, session: Session, readings: Readings | BatchReadings, now: float, equal: bool) -> list[Effect]:
        """Begin to drive. An agent that does not equal its predecessor first asks it for what it knows."""
        said = Say(f"drives from tick {readings.tick} on")
        predecessor = session.following.predecessor_at(readings)
        if equal or not predecessor:
            return [said, *self._drive(session, readings, now)]
        self._wait(readings)
        return [said, *session.following.ask(predecessor, now)]

    def _follow(self, session: Session, readings: Any, now: float, fresh: bool) -> list[Effect]:
        """Learn from what another driver does; a standby of its kind keeps in step with it."""
        following, seat = session.following, self.seat
        effects: list[Effect] = following.ask(following.leader, now, probe=True) if fresh else []
        if seat.place is Place.IN_STEP and session.missed(readings):
            seat.learn(Seen.GAP)
        if fresh and seat.place is not Place.IN_STEP:
            self._wait(readings)
            return effects
        behind = seat.mode == "stand by" and following.leader == readings.driver  # a former leader may be gone
        if behind and seat.place is not Place.IN_STEP and following.due(now) and not following.probes:
            self._wait(readings)
            return [*effects, *following.ask(following.leader, now, probe=following.related is None)]
        if seat.place in (Place.SHADOWING, Place.IN_STEP):
            effects += self._learn(session, readings, now)[0]
        return effects

    def _drive(self, session: Session, readings: Readings | BatchReadings, now: float) -> list[Effect]:
        """Answer one tick; nobody hears the answer before the journal has what led to it."""
        agent = session.agent
        fresh = (readings.run, readings.tick) != agent.tick
        effects, command = self._learn(session, readings, now)
        if command is None:
            return effects
        if 0 < session.world.epochs <= readings.epoch:  # on disk before the run is seen to be finished
            effects += self._keeping.save(agent, now, complete=True)
        effects.append(Publish(session.topics.command, command))
        return [*effects, row(agent)] if fresh else effects

    def _learn(self, session: Session, readings: Any, now: float) -> tuple[list[Effect], Any]:
        """What keeps one tick, and the command for it, whether it will count or not."""
        agent, effects = session.agent, list[Effect]()
        fresh = (readings.run, readings.tick) != agent.tick
        try:
            command = session.answering.once(readings)
        except Refused as why:
            return [Refuse(session.topics.readings, str(why))], None
        if fresh and session.answering.whole and command is not None:
            effects += self._keeping.entry(readings)
        if self._keeping.due(now):
            effects += self._keeping.save(agent, now)
        return effects, command

    def _answer(self, answer: Answer, now: float) -> list[Effect]:
        """What came of a question."""
        if answer.tag == RELEASE:
            saved = [] if self.agent is None else self._keeping.save(self.agent, now, last=True)
            return [*saved, Stop()]
        if self.seat.place is Place.LEAVING:
            return []
        if answer.tag == SEAT:
            return self.seat.answered(answer.first)
        if answer.tag == WORLD:
            return self._meet(answer.first, now)
        return self._heard(answer, now)

    def _heard(self, answer: Answer, now: float) -> list[Effect]:
        """What the followed agent, or the predecessor, said."""
        session = self._session
        if session is None:
            return []
        outcome, effects = session.following.answered(answer, now)
        if outcome is None:
            return []
        driving = self.seat.place is Place.DRIVING
        if outcome == "inherited":
            session.resume()
            effects += self._keeping.save(session.agent, now)
        if not driving and outcome != "same kind":
            self.seat.learn(
                Seen.EQUAL if outcome == "inherited" else Seen.APART, for_good=session.following.related is False
            )
        return [*effects, *self._go_on(now)]

    def _meet(self, world: World | None, now: float) -> list[Effect]:
        """Enter the run of a world, if its readings wait."""
        self._asks_world = False
        session, waiting = self._session, self._waiting
        known = None if session is None else session.world.run
        if world is None or world.run == known or all(readings.run != world.run for readings in waiting):
            self._waiting = deque((one for one in waiting if one.run == known), MAX_WAITING)
            return []
        effects: list[Effect] = [Flush()]
        if session is None:
            refuse_mode(world, self.seat.mode)
            agent = self._make(world)
            agent.author = self.seat.ident
            effects += restored(agent, self._kept, world.arena)
        else:
            agent = session.agent
            agent.enter(world.arena)
        session = self._session = Session(world, agent)
        self.seat.enter()
        again = self._keeping.enter(world.run, agent.tick, now)
        if again is None:
            effects += self._keeping.begin(world.run, agent, now)
        for readings in again or ():
            session.answering.once(readings)
            effects.append(row(agent))
        return [*effects, *self._go_on(now)]

    def _bequeath(self, event: Event) -> list[Effect]:
        """Tell a successor what it needs to continue."""
        request: CheckpointRequest | None = event.message
        if request is None or request.agent != self.seat.ident or event.reply is None:
            return []
        return [Reply(event.reply, bequest(self.agent, request))]

    def _leave(self) -> list[Effect]:
        if self._session is None:
            return [Stop()]
        return [] if self.seat.place is Place.LEAVING else [Flush(), *self.seat.leave()]
