"""The client's side of the driver's seat: when to ask for it, and what each message says about the driver."""

import math
from enum import StrEnum
from typing import Literal

from phototaxis.runtime.machine import Ask, Effect, Say
from phototaxis.runtime.transitions import Transitions
from phototaxis.wire.messages import BatchReadings, Control, ControlReply, Readings

Mode = Literal["claim", "take over", "stand by"]
"""How the seat is sought: when it is free; from whoever holds it; when its holder vanishes."""

SEAT, RELEASE = "seat", "release"
"""Tags of the questions to the simulation."""
ASK_EVERY_S = 0.2
"""Pause between two questions when the first one was refused or lost."""
RELEASE_WITHIN_S = 0.5
MATCH_WITHIN_S = 5.0
"""Time that a standby gets to become the driver's equal; after it, the standby takes a free seat as it is."""


class Place(StrEnum):
    """A client's state with respect to the seat."""

    SEEKING = "seeking"
    """Nobody drives, as far as it knows."""
    QUEUED = "queued"
    """Another one drives, and it waits."""
    SHADOWING = "shadowing"
    """It waits, and learns from what the driver does."""
    IN_STEP = "in step"
    """It waits as the driver's equal: it has its state, and goes through every tick as the driver does."""
    DRIVING = "driving"
    SUPERSEDED = "superseded"
    """It has driven, and a successor's command has been applied."""
    LEAVING = "leaving"


class Seen(StrEnum):
    """What a client learns about the seat."""

    NAMED = "named the driver"
    FREE = "nobody drives"
    TAKEN = "another one drives"
    SUCCEEDED = "its successor has driven"
    APART = "is not the driver's equal"
    EQUAL = "inherited"
    GAP = "missed a tick"
    RUN = "another run"
    WANTED = "wants the seat"
    LEFT = "leaves"


P, S = Place, Seen

TABLE: dict[tuple[Place, Seen], Place] = {
    (P.SEEKING, S.NAMED): P.DRIVING,
    (P.SEEKING, S.FREE): P.SEEKING,
    (P.SEEKING, S.TAKEN): P.QUEUED,
    (P.SEEKING, S.SUCCEEDED): P.SUPERSEDED,
    (P.QUEUED, S.NAMED): P.DRIVING,
    (P.QUEUED, S.FREE): P.SEEKING,
    (P.QUEUED, S.TAKEN): P.QUEUED,
    (P.QUEUED, S.SUCCEEDED): P.SUPERSEDED,
    (P.QUEUED, S.APART): P.SHADOWING,
    (P.QUEUED, S.EQUAL): P.IN_STEP,
    (P.SHADOWING, S.NAMED): P.DRIVING,
    (P.SHADOWING, S.FREE): P.SHADOWING,
    (P.SHADOWING, S.TAKEN): P.SHADOWING,
    (P.SHADOWING, S.APART): P.SHADOWING,
    (P.SHADOWING, S.EQUAL): P.IN_STEP,
    (P.IN_STEP, S.NAMED): P.DRIVING,
    (P.IN_STEP, S.FREE): P.IN_STEP,
    (P.IN_STEP, S.TAKEN): P.IN_STEP,
    (P.IN_STEP, S.APART): P.SHADOWING,
    (P.IN_STEP, S.GAP): P.QUEUED,
    (P.DRIVING, S.NAMED): P.DRIVING,
    (P.DRIVING, S.FREE): P.SEEKING,
    (P.DRIVING, S.TAKEN): P.QUEUED,
    (P.SUPERSEDED, S.FREE): P.SEEKING,
    (P.SUPERSEDED, S.NAMED): P.DRIVING,
    (P.SUPERSEDED, S.SUCCEEDED): P.SUPERSEDED,
    (P.SUPERSEDED, S.TAKEN): P.SUPERSEDED,
    **{(place, S.WANTED): P.SEEKING for place in P if place is not P.LEAVING},
    **{(place, S.RUN): P.SEEKING for place in P if place is not P.LEAVING},
    **{(place, S.LEFT): P.LEAVING for place in P},
}
"""Which input leads from which place to which."""


class SeatClient:
    """Seeks the seat for one client, an agent's or a program's, and knows who holds it.

    It asks one question at a time, and asks again `ASK_EVERY_S` after one that was refused or not answered. A
    restarted simulation does not know which clients wait, so the client asks it again.

    Parameters
    ----------
    ident : the client's name on the bus.
    mode, at : how the seat is sought, and from which tick on it is taken over. A client that has taken
        it over once claims it from then on.
    """

    def __init__(self, ident: str, mode: Mode = "claim", at: int = 0):
        self.ident, self._at = ident, at
        self.mode: Mode = mode
        self._place = Transitions(TABLE, Place.SEEKING)
        self._known = self._has_driven = False
        self._asked: Mode | None = None
        """How the question that is out asks for the seat."""
        self._ask_at = -math.inf
        self._moment = ("", -1)
        """Run and tick of the newest readings."""
        self._named_at = math.inf
        """The newest tick whose readings name this client; infinity before any do."""
        self._named: list[str] = []
        """Who was named the driver in them, the last one last."""
        self._driver: str | None = None
        """Whom the newest readings name; None before there are any."""
        self._match_by = math.inf
        """Until when a standby waits to become the equal of that driver; −infinity when it cannot."""

    @property
    def place(self) -> Place:
        """The client's state with respect to the seat."""
        return self._place.state

    def see(self, readings: Readings | BatchReadings, now: float) -> list[Effect]:
        """Take in whom the readings name as the driver, unless they are stale; ask for the seat where that is due."""
        if self.stale(readings):
            return []
        before, driver = self.place, readings.driver
        self._note(readings, now)
        after = self._place.take(self._meaning(readings))
        if after is Place.DRIVING:
            self._named_at = readings.tick
            if before is not Place.DRIVING:
                self._has_driven = True
                self.mode = "claim" if self.mode == "take over" else self.mode
            return []
        said: list[Effect] = []
        if before is Place.DRIVING:
            self._known = False
            said.append(Say(f"unseated at tick {readings.tick}: {driver or 'nobody'} drives"))
        if after is Place.QUEUED and before is not Place.QUEUED and self.mode == "claim":
            said.append(Say(f"waits until {driver} leaves the seat; --take-over takes it, --standby inherits it"))
        return [*said, *self._seek(readings, now)]

    def stale(self, readings: Readings | BatchReadings) -> bool:
        """Whether the readings are out of date: a later tick of the run, or a later driver of the same tick, was seen.

        Readings that name this client are never stale: a surplus answer is not applied, a missing one stops the run.
        Readings with a free seat are never stale either: a restarted simulation shows one.
        """
        run, tick = self._moment
        if readings.run != run or readings.tick > tick:
            return False
        return readings.tick < tick or (readings.driver != self.ident and readings.driver in self._named[:-1])

    def want(self, mode: Mode, now: float) -> list[Effect]:
        """Seek the seat in this way from now on, and ask at once."""
        self.mode, self._known, self._ask_at = mode, False, -math.inf
        self._place.take(Seen.WANTED)
        return self._ask(now, mode)

    def answered(self, reply: ControlReply | None) -> list[Effect]:
        """What the simulation said to the last question; None when it did not answer."""
        asked, self._asked = self._asked, None
        if reply is None or not reply.ok or asked == "claim":
            return []
        status, self._known = reply.status, asked == self.mode
        waits = "stands by" if asked == "stand by" else f"takes over from tick {self._at} on"
        return [Say(f"{waits}; {status.driver or 'nobody'} drives at tick {status.tick}")]

    def seated(self) -> None:
        """The simulation's answer names this client the driver, before any readings do."""
        self._place.take(Seen.NAMED)
        self._has_driven, self.mode = True, "claim"

    def simulation_is_back(self) -> None:
        """Forget what a simulation knew before it restarted: it may not know this client, and may seat another one."""
        self._known = False
        self._named.clear()

    def enter(self) -> None:
        """Begin anew in another run."""
        self._place.take(Seen.RUN)
        self._known = self._has_driven = False
        self._driver, self._named_at = None, math.inf

    def learn(self, seen: Literal[Seen.APART, Seen.EQUAL, Seen.GAP], for_good: bool = False) -> None:
        """Take in how this client compares with the driver that it follows; `for_good`: this will not change."""
        self._match_by = -math.inf if for_good else self._match_by
        self._place.take(seen)

    def leave(self) -> list[Effect]:
        """Give the seat back, or the place in the queue for it."""
        self._place.take(Seen.LEFT)
        return [Ask(RELEASE, "control", Control(verb="release", agent=self.ident), RELEASE_WITHIN_S)]

    def _note(self, readings: Readings | BatchReadings, now: float) -> None:
        """Remember whom the readings name, after all whom the same tick has named."""
        moment, driver = (readings.run, readings.tick), readings.driver
        if driver != self._driver:
            self._driver, self._match_by = driver, now + MATCH_WITHIN_S
            self._known = self._known and self.mode != "stand by"
        if moment != self._moment:
            self._moment, self._named = moment, []
        if driver:
            self._named = [*(name for name in self._named if name != driver), driver]

    def _meaning(self, readings: Readings | BatchReadings) -> Seen:
        driver = readings.driver
        if driver == self.ident:
            return Seen.NAMED
        waited = self.place in (Place.SEEKING, Place.QUEUED, Place.SUPERSEDED)
        if waited and self._has_driven and self.mode != "stand by" and self._succeeded(readings):
            return Seen.SUCCEEDED
        return Seen.TAKEN if driver else Seen.FREE

    def _succeeded(self, readings: Readings | BatchReadings) -> bool:
        """Whether another client has driven since this one did; it may be gone again, and nobody be named."""
        later = readings.tick > self._named_at  # at that tick itself the author is our predecessor
        return readings.author not in ("", self.ident) and (later or readings.author == readings.driver)

    def _seek(self, readings: Readings | BatchReadings, now: float) -> list[Effect]:
        """Ask where the mode wants it: a claim while nobody drives, everything else until the simulation knows.

        A standby claims a free seat, too: if it came late, it would be in the queue without being the driver's equal.
        """
        verb: Mode = "claim" if self.mode == "stand by" and not readings.driver else self.mode
        if self.mode == "claim":
            wanted = not readings.driver
        else:
            wanted = not self._known and (self.mode == "take over" or self._ready(readings, now))
        return self._ask(now, verb) if wanted and now >= self._ask_at else []

    def _ready(self, readings: Readings | BatchReadings, now: float) -> bool:
        """Whether a standby may get the seat: as an equal, or where there is nothing to inherit, or not in time."""
        untouched = readings.tick == 0 and not readings.driver
        return self.place is Place.IN_STEP or untouched or now >= self._match_by

    def _ask(self, now: float, verb: Mode) -> list[Effect]:
        if self._asked is not None:
            return []
        self._asked, self._ask_at = verb, now + ASK_EVERY_S
        return [Ask(SEAT, "control", Control(verb=verb, agent=self.ident, at=self._at))]
