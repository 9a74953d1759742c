"""Publishes a component's log in chunks, without delaying the tick path.

Rows are collected and sent as columns, 16 ticks or 50 ms at a time; Zenoh may drop them under congestion.
The newest chunks are kept, so that a recorder that missed some or started late can ask for them.
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
    """The part of `phototaxis.runtime.bus.Bus` that `LogPublisher` uses."""

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
        """When the waiting rows must be sent, on the clock of `now`."""
        return self._since + CHUNK_AGE_S if self._rows else math.inf

    def add(self, head: tuple[Any, ...], row: tuple[Any, ...], now: float) -> None:
        """Add one tick's row, and send the chunk if it is full."""
        if head != self._head:
            self.flush()
            self._head = head
        if not self._rows:
            self._since = now
        self._rows.append(row)
        if len(self._rows) >= CHUNK_ROWS:
            self.flush()

    def poll(self, now: float) -> None:
        """Send the waiting rows if their deadline has passed."""
        if now >= self.deadline:
            self.flush()

    def flush(self) -> None:
        """Send the waiting rows now."""
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
