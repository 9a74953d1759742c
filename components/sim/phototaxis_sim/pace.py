"""Decides when a tick ends: when its command comes (lockstep), or by the clock (real time)."""

STOP_AFTER_PERIODS = 2.0
"""In real time the motors stop when the newest command is older than this many control periods."""


class Pace:
    """Turns the speed of a run into the time at which each tick ends.

    speed 0 is lockstep: a tick ends when its command comes. A speed s > 0 ends a tick every
    control_period / s seconds, with the newest command; times are seconds of a monotonic clock.

    Attributes
    ----------
    ends_at : when the present tick ends by the clock.
    """

    def __init__(self, period: float, speed: float = 0.0):
        self._period = period
        self.speed = speed
        self.ends_at = 0.0
        self._commanded = -float("inf")

    @property
    def realtime(self) -> bool:
        return self.speed > 0

    def set(self, speed: float, now: float) -> None:
        """Change the speed from now on."""
        self.speed = speed
        self.ends_at = now + self._length()

    def begun(self, now: float) -> None:
        """A tick has begun; a late one does not make the next ones hurry."""
        self.ends_at = max(self.ends_at + self._length(), now)

    def commanded(self, now: float) -> None:
        """A command for the present tick has come."""
        self._commanded = now

    def wait(self, now: float) -> float:
        """Seconds until the present tick ends by the clock."""
        return max(self.ends_at - now, 0.0)

    def stale(self, now: float) -> bool:
        """Whether the newest command is too old to drive on."""
        return now - self._commanded > STOP_AFTER_PERIODS * self._length()

    def _length(self) -> float:
        return self._period / self.speed if self.speed else 0.0
