"""What a component wants recorded, published in chunks beside the tick path.

Rows are gathered and sent as columns, 16 ticks or 50 ms at a time, on a key that drops under pressure;
the newest chunks are kept so that a recorder that missed some, or came late, can ask for them.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from phototaxis.runtime.machine import Event
from phototaxis.wire.codec import encode
from phototaxis.wire.messages import LogRequest, Message

CHUNK_ROWS, CHUNK_AGE_S, MAX_KEPT_CHUNKS = 16, 0.05, 2048


class Bus(Protocol):
    """What chunks need of a component's place on the bus."""

    @property
    def ident(self) -> str: ...
    def put(self, topic: str, message: bytes) -> None: ...


class LogPublisher:
    """Gathers rows and publishes them on one log topic.

    `make(seq, head, columns)` builds the message from the transposed rows. A chunk has one head, such as the run and
    the driver: rows under another head begin another chunk.
    """

    def __init__(self, bus: Bus, topic: str, make: Callable[[int, tuple[Any, ...], list[tuple[Any, ...]]], Message]):
        self.topic = topic
        self._bus, self._make = bus, make
        self._head: tuple[Any, ...] = ()
        self._rows: list[tuple[Any, ...]] = []
        self._kept: deque[tuple[int, bytes]] = deque(maxlen=MAX_KEPT_CHUNKS)
        self._seq = 0
        self._since = 0.0

    @property
    def deadline(self) -> float:
        """When the rows that wait must be sent."""
        return self._since + CHUNK_AGE_S if self._rows else math.inf

    def add(self, head: tuple[Any, ...], row: tuple[Any, ...], now: float) -> None:
        """Add one tick's row; a full chunk is sent."""
        if head != self._head:
            self.flush()
            self._head = head
        if not self._rows:
            self._since = now
        self._rows.append(row)
        if len(self._rows) >= CHUNK_ROWS:
            self.flush()

    def poll(self, now: float) -> None:
        """Send a chunk that has waited long enough."""
        if now >= self.deadline:
            self.flush()

    def flush(self) -> None:
        """Send what there is."""
        if self._rows:
            payload = encode(self._make(self._seq, self._head, list(zip(*self._rows, strict=True))))
            self._rows.clear()
            self._kept.append((self._seq, payload))
            self._seq += 1
            self._bus.put(self.topic, payload)

    def answer(self, request: Event) -> None:
        """Answer a recorder's request with every kept chunk from its `seq` on, the newest rows included."""
        wanted = request.message if isinstance(request.message, LogRequest) else LogRequest()
        if wanted.writer not in ("", self._bus.ident):
            return
        self.flush()
        if request.reply is not None:
            for seq, payload in self._kept:
                if seq >= wanted.seq:
                    request.reply(payload)
