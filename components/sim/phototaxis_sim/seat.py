"""The driver's seat: which agent drives, which takes over next, and which stand by."""

from phototaxis.wire.codec import Refused
from phototaxis.wire.messages import SeatChange, SeatChangeReason

MAX_HISTORY = 50
"""Most changes of the seat in `Seat.history`."""


class Seat:
    """Holds the name of the driver; only the driver's commands count.

    Parameters
    ----------
    heir : while it is set, nobody else may sit down on the free seat: the driver of a simulation that was
        killed and continues.

    Attributes
    ----------
    driver : the agent that holds the seat; "" for none.
    standbys : the agents that take the seat when the driver vanishes, in this order. A new driver begins with none,
        because an agent that stood by for another one may not know what this one knows; it asks again.
    reserved : the agents that take the seat over, and each one's first possible tick.
    history : the changes of the seat, the newest last.
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
        """Give an agent the seat if it is free.

        Raises
        ------
        Refused
            when the seat is taken, or kept for another agent.
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
        """Let an agent take the seat over at the first tick boundary from tick `at` on."""
        _named(agent)
        if agent != self.driver:
            self.reserved[agent] = at

    def stand_by(self, agent: str, tick: int) -> None:
        """Queue an agent that drives when no other agent does."""
        _named(agent)
        if agent != self.driver and agent not in self.standbys:
            self.standbys.append(agent)
            if not self.driver:
                self.vacate(tick)

    def boundary(self, tick: int) -> bool:
        """Hand over to an agent that has reserved `tick` or an earlier one; return whether the driver changed."""
        agent = self.next(tick)
        if agent not in self.reserved:
            return False
        self._give(agent, tick, "took over")
        return True

    def leave(self, agent: str, tick: int) -> bool:
        """Free the seat if `agent` holds it, and seat the next agent; return whether `agent` held it."""
        self.reserved.pop(agent, None)
        if agent in self.standbys:
            self.standbys.remove(agent)
        if self.driver != agent or not agent:
            return False
        self.vacate(tick)
        return True

    def release(self, agent: str, tick: int) -> None:
        """Let an agent give the seat back by request.

        Raises
        ------
        Refused
            when another agent holds the seat.
        """
        if not self.leave(agent, tick):
            raise Refused(f"{agent} does not hold the seat")

    def next(self, tick: int) -> str:
        """The agent that would get the seat if it were vacated now; "" for none."""
        due = [agent for agent, at in self.reserved.items() if at <= tick]
        if due:
            return min(due, key=self.reserved.__getitem__)
        return self.standbys[0] if self.standbys and not self.heir else ""

    def vacate(self, tick: int) -> bool:
        """Take the seat from its holder and give it to the next agent; return whether there was one."""
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
