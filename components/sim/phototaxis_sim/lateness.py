"""In real time: how many ticks passed without a command, which part was too slow, and when that matters."""

from collections import deque

RECENT_TICKS = 100
MIN_LATE_TICKS = 10
"""So many late ones among the recent ticks are worth a word."""


class Lateness:
    """Counts the ticks that ended by the clock before their command came.

    Attributes
    ----------
    ticks : how many there were.
    unsensed : in how many of them the readings had not come either: the sensors were too slow.
    """

    def __init__(self) -> None:
        self.ticks = self.unsensed = 0
        self._recent: deque[str] = deque(maxlen=RECENT_TICKS)

    def in_time(self) -> None:
        """A tick ended with its command."""
        self._recent.append("")

    def late(self, sensed: bool) -> None:
        """A tick ended without its command; `sensed`: its readings had come."""
        self.ticks += 1
        self.unsensed += not sensed
        self._recent.append("agent" if sensed else "sensors")

    def told(self, agent: str, sensors: str) -> str:
        """Which part is too slow now, and how often, for people; "" while it does not matter."""
        counts = {agent: self._recent.count("agent"), sensors: self._recent.count("sensors")}
        late = sum(counts.values())
        if late < MIN_LATE_TICKS:
            return ""
        slower = max(counts, key=counts.__getitem__)
        return f"{slower} is too slow: {late} of the last {len(self._recent)} ticks had no command in time"
