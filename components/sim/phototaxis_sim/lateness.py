"""Counts the ticks that passed without a command in real time, and tells which component is too slow."""

from collections import deque

RECENT_TICKS = 100
MIN_LATE_TICKS = 10
"""Late ticks among the recent ones from which on a warning is given."""


class Lateness:
    """Counts the ticks that ended by the clock before their command came.

    Attributes
    ----------
    ticks : number of late ticks.
    unsensed : number of late ticks whose readings had not come either, so that the sensors were too slow.
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
        """A line that says which component is too slow and how often; "" while few ticks are late."""
        counts = {agent: self._recent.count("agent"), sensors: self._recent.count("sensors")}
        late = sum(counts.values())
        if late < MIN_LATE_TICKS:
            return ""
        slower = max(counts, key=counts.__getitem__)
        return f"{slower} is too slow: {late} of the last {len(self._recent)} ticks had no command in time"
