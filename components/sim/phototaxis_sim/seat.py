"""The one seat: who may drive, who drives next, and who stands by."""

from phototaxis.wire.codec import Refused
from phototaxis.wire.messages import SeatChange, SeatChangeReason

MAX_HISTORY = 50
"""Holders of the seat that are remembered."""


class Seat:
    """Holds the name of the driver; only the driver's commands count.

    Parameters
    ----------
    heir : while it is set, nobody else may sit down on the free seat: the driver of a simulation that was
        killed and continues.

    Attributes
    ----------
    driver : who holds the seat; "" for nobody.
    standbys : who takes it when the driver vanishes, in this order. A new driver has none: who stood by the one
        before may not know what this one knows, and asks again.
    reserved : who takes it over, and from which tick on.
    history : who held it since when, the newest last.
    """

    def __init__(self, heir: str = ""):
        self.driver, self.heir = "", heir
        self.standbys: list[str] = []
        self.reserved: dict[str, int] = {}
        self.history: list[SeatChange] = []

    @property
    def waiting(self) -> list[str]:
        """Who will or would drive next."""
        return [*sorted(self.reserved, key=self.reserved.__getitem__), *self.standbys]

    def claim(self, agent: str, tick: int) -> None:
        """Sit down if the seat is free.

        Raises
        ------
        Refused
            when it is taken, or kept for somebody else.
        """
        _named(agent)
        if self.driver == agent:
            return
        if self.driver:
            raise Refused(f"the seat is taken by {self.driver}")
        if self.heir and agent != self.heir:
            raise Refused(f"the seat is kept for {self.heir}")
        self._give(agent, tick, "claimed")

    def reserve(self, agent: str, at: int) -> None:
        """Take the seat over at the first tick boundary from tick `at` on."""
        _named(agent)
        if agent != self.driver:
            self.reserved[agent] = at

    def stand_by(self, agent: str, tick: int) -> None:
        """Drive when nobody else does."""
        _named(agent)
        if agent != self.driver and agent not in self.standbys:
            self.standbys.append(agent)
            if not self.driver:
                self.vacate(tick)

    def boundary(self, tick: int) -> bool:
        """Between two ticks: hand over to who has reserved `tick` or an earlier one; whether the driver changed."""
        agent = self.next(tick)
        if agent not in self.reserved:
            return False
        self._give(agent, tick, "took over")
        return True

    def leave(self, agent: str, tick: int) -> bool:
        """Free the seat if `agent` holds it, and let the next one sit down; whether it held it."""
        self.reserved.pop(agent, None)
        if agent in self.standbys:
            self.standbys.remove(agent)
        if self.driver != agent or not agent:
            return False
        self.vacate(tick)
        return True

    def release(self, agent: str, tick: int) -> None:
        """Leave the seat on purpose.

        Raises
        ------
        Refused
            when it is somebody else's.
        """
        if not self.leave(agent, tick):
            raise Refused(f"{agent} does not hold the seat")

    def next(self, tick: int) -> str:
        """Who would sit down if the seat were vacated now; "" for nobody."""
        due = [agent for agent, at in self.reserved.items() if at <= tick]
        if due:
            return min(due, key=self.reserved.__getitem__)
        return self.standbys[0] if self.standbys and not self.heir else ""

    def vacate(self, tick: int) -> bool:
        """Take the seat from its holder and let the next one sit down, if there is one; whether there was."""
        self.driver = ""
        agent = self.next(tick)
        if agent:
            self._give(agent, tick, "took over" if agent in self.reserved else "stood by")
        return bool(agent)

    def _give(self, agent: str, tick: int, how: SeatChangeReason) -> None:
        self.reserved.pop(agent, None)
        self.standbys.clear()
        self.driver, self.heir = agent, ""
        self.history = [*self.history, SeatChange(driver=agent, tick=tick, how=how)][-MAX_HISTORY:]


def _named(agent: str) -> None:
    if not agent:
        raise Refused("a claim names its agent")
