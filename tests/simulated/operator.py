"""Somebody at a terminal: puts requests to the simulation, one after the other, each until it is answered."""

import math
from collections import deque

from phototaxis.runtime.machine import Ask, Effect, Event
from phototaxis.wire.messages import Control

ASK_EVERY_S = 0.2
"""Pause before a request that was not answered is put again."""


class Operator:
    """A machine whose events are the requests that it shall put (`"request"`) and what comes back."""

    def __init__(self) -> None:
        self._requests: deque[Control] = deque()
        self._out, self._ask_at = False, -math.inf

    @property
    def deadline(self) -> float:
        """When the next request is put."""
        return self._ask_at if self._requests and not self._out else math.inf

    def on(self, event: Event, now: float) -> list[Effect]:
        """What follows from an event."""
        if event.topic == "request":
            self._requests.append(event.message)
        elif event.topic == "answer":
            self._out = False
            if event.message.first is None:
                self._ask_at = now + ASK_EVERY_S
            else:
                self._requests.popleft()
        if now < self.deadline:
            return []
        self._out = True
        return [Ask("operator", "control", self._requests[0])]
