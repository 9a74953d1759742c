"""Virtual time: a clock that jumps from one event to the next."""

import heapq
from collections.abc import Callable
from itertools import count
from typing import Any


class Timeline:
    """A heap of calls to come. Calls of the same moment happen in the order in which they were planned.

    Attributes
    ----------
    now : seconds since the beginning.
    """

    def __init__(self) -> None:
        self.now = 0.0
        self._heap: list[tuple[float, int, Callable[..., object], tuple[Any, ...]]] = []
        self._count = count()

    def at(self, when: float, call: Callable[..., object], *given: Any) -> None:
        """Plan a call; one in the past happens now."""
        heapq.heappush(self._heap, (max(when, self.now), next(self._count), call, given))

    def after(self, seconds: float, call: Callable[..., object], *given: Any) -> None:
        """Plan a call so many seconds from now."""
        self.at(self.now + seconds, call, *given)

    def run(self, until: Callable[[], bool], limit: float) -> bool:
        """Make calls until `until` holds after one of them; False when it does not within `limit` seconds of now."""
        end = self.now + limit
        while self._heap and self._heap[0][0] <= end:
            self.now, _, call, given = heapq.heappop(self._heap)
            call(*given)
            if until():
                return True
        return False
