"""Puts the chunks of one log topic in order, and asks for those that are missing.

Chunks may be dropped under load, and a recorder may start late or restart. So each chunk has a number, and its writer
keeps it for a while, so that the recorder can ask for it again.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Any

from phototaxis.runtime.machine import Ask, Effect, Own
from phototaxis.wire.messages import LogRequest


class Write(Own):
    """Add a chunk to the recording."""

    topic: str
    chunk: Any


class LogReader:
    """Reads one log topic of one run. Chunks that follow a gap wait until the question for the gap is answered.

    Attributes
    ----------
    newest : the newest tick that was written; −1 for none.
    heard : the time at which the newest chunk came.
    open : the tags of the questions that are not answered yet.
    """

    def __init__(self, topic: str, run: str, tags: Iterator[int], alive: set[str]):
        self.topic, self.newest, self.heard, self.open = topic, -1, -math.inf, set[str]()
        self._run, self._tags, self._alive = run, tags, alive
        self._writer = ""
        """The writer of the newest chunk."""
        self._expected: dict[str, int] = {}
        """The number of the next chunk of each writer."""
        self._held: list[Any] = []
        """Chunks that came while a question was open."""
        self._asked: set[str] = set()
        """The writers that open questions ask for what precedes a held chunk; "" stands for all writers.

        An answer tells only of chunks that were published before the question came."""
        self._found: list[Any] = []
        """Chunks from the answers that came while other questions were open."""

    def came(self, chunk: Any, now: float) -> Iterator[Effect]:
        """Take a chunk that was published."""
        self.heard = now
        self._held.append(chunk)
        yield from self._go_on()

    def answered(self, tag: str, chunks: Iterable[Any]) -> Iterator[Effect]:
        """Take the answer to a question; after the last open one, a chunk that is still missing counts as lost."""
        self.open.remove(tag)
        self._found += chunks
        if self.open:
            return
        found, asked, self._found, self._asked = self._found, self._asked, [], set()
        for chunk in sorted(found, key=lambda chunk: chunk.tick[0]):
            yield from self._write(chunk)
        if self._held:
            self._writer = self._held[0].writer  # the writer before this one has been asked already
            if asked & {"", self._writer}:
                yield from self._write(self._held.pop(0))
        yield from self._go_on()

    def ask(self) -> Iterator[Effect]:
        """Ask the newest writer for missing chunks, or all writers if none is known."""
        yield from self._ask(self._writer)

    def _go_on(self) -> Iterator[Effect]:
        """Write the chunks that wait, up to the next gap."""
        while self._held and not self.open:
            chunk, former = self._held[0], self._writer
            self._writer = chunk.writer
            if former not in ("", chunk.writer):
                yield from self._ask(former)  # chunks of the former writer precede this one
            if not self.open and chunk.seq > self._expected.get(chunk.writer, 0):
                yield from self._ask(chunk.writer)
            if not self.open:
                yield from self._write(self._held.pop(0))

    def _ask(self, writer: str) -> Iterator[Effect]:
        if writer and writer not in self._alive:
            return
        tag = f"{self.topic} {next(self._tags)}"
        self.open.add(tag)
        if self._held:
            self._asked.add(writer)
        yield Ask(tag, self.topic, LogRequest(seq=self._expected.get(writer, 0), writer=writer), every=True)

    def _write(self, chunk: Any) -> Iterator[Effect]:
        """Write a chunk, unless it is of another run or was written before."""
        if chunk.run != self._run or chunk.seq < self._expected.get(chunk.writer, 0):
            return
        self._writer, self._expected[chunk.writer] = chunk.writer, chunk.seq + 1
        self.newest = max(self.newest, chunk.tick[-1])
        yield Write(topic=self.topic, chunk=chunk)
