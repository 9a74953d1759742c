"""One process of the simulated system: the real loop around a real machine, which may be killed between two effects."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from phototaxis.runtime import machine as m
from phototaxis.runtime.chunks import LogPublisher
from phototaxis.runtime.journal import Journal
from phototaxis.runtime.runner import Runner
from phototaxis.runtime.store import Store
from phototaxis.wire.codec import Refused, encode
from phototaxis.wire.messages import Message

from simulated.decoders import DECODERS, REQUESTS

if TYPE_CHECKING:
    from simulated.network import Network


class Killed(BaseException):
    """The process dies here; its memory is lost, its disk is kept."""


class Process:
    """A place on the network, and the loop that lives there.

    Parameters
    ----------
    network : where it is; it joins with `start`.
    role, ident : as on the bus.
    carried : is told each effect after it was carried out.

    Attributes
    ----------
    listens : topics that it receives at times.
    dead, frozen : what has become of it.
    kill_in : it dies when it would carry out the effect with this number, counted from now; None: it lives on.
    tear : a journal entry that it dies at is written in part, up to this share of its bytes; None: not at all.
    """

    def __init__(
        self, network: Network, role: str, ident: str, carried: Callable[[Process, m.Effect], None] | None = None
    ):
        self.network, self.role, self.ident = network, role, ident
        self.listens: set[str] = set()
        self.dead = self.frozen = False
        self.kill_in: int | None = None
        self.tear: float | None = None
        self.loop: Loop | None = None
        self.carried = carried or (lambda *_: None)
        self._inbox: deque[tuple[str, Any]] = deque()
        self._wakes_at = float("inf")

    def start(
        self,
        machine: m.Machine,
        journal: Journal | None = None,
        store: Store | None = None,
        log: LogPublisher | None = None,
    ) -> None:
        """Join the network and run the machine."""
        self.loop = Loop(self, machine, journal, store, log)
        self.network.join(self)
        self._turn(m.START)

    def deliver(self, kind: str, item: Any) -> None:
        """Something has come; a frozen process finds it when it thaws."""
        self._inbox.append((kind, item))
        self._work()

    def thaw(self) -> None:
        """Go on after a freeze, with all that came meanwhile."""
        self.frozen = False
        self._work()

    def kill(self) -> None:
        """End without a word."""
        if not self.dead:
            self.dead = True
            if self.loop is not None:
                self.loop.drop()
            self.network.leave(self)

    def stop(self) -> None:
        """Ask the process to end in good order."""
        self.deliver("event", m.STOP)

    def receive(self, timeout: float) -> m.Event | None:
        """Events are handed to the loop one by one instead."""
        raise NotImplementedError

    def put(self, topic: str, message: Message | bytes) -> None:
        self.network.publish(self, topic, message if isinstance(message, bytes) else encode(message))

    def ask_aside(self, ask: m.Ask) -> None:
        self.network.ask(self, ask)

    def listen(self, topic: str, wanted: bool) -> None:
        (self.listens.add if wanted else self.listens.discard)(topic)

    def refuse(self, topic: str, why: str) -> None:
        """Nobody reads this process's standard error."""

    def _work(self) -> None:
        while self._inbox and not self.dead and not self.frozen:
            event = self._decoded(*self._inbox.popleft())
            if event is not None:
                self._turn(event)

    def _decoded(self, kind: str, item: Any) -> m.Event | None:
        if kind == "event":
            return item
        if kind == "reply":
            item[0].heard(item[1])
            return None
        topic, payload = item[:2]
        try:
            if kind == "message":
                return m.Event(topic, DECODERS[topic](payload))
            return m.Event(topic, REQUESTS[topic](payload) if payload else None, item[2])
        except Refused as why:
            return m.Event("refused", m.Refusal(topic, str(why)))

    def _turn(self, event: m.Event) -> None:
        assert self.loop is not None
        try:
            self.loop.handle(event)
        except Killed:
            return self.kill()
        if not self.loop.running:
            self.loop.finish()
            return self.kill()
        self._plan(self.network.timeline.now + self.loop.wait())
        return None

    def _plan(self, when: float) -> None:
        if when < self._wakes_at:
            self._wakes_at = when
            self.network.timeline.at(when, self._wake, when)

    def _wake(self, planned: float) -> None:
        if planned != self._wakes_at:
            return
        self._wakes_at = float("inf")
        if not self.dead and not self.frozen and self.loop is not None:
            left = self.loop.wait()
            self._turn(m.TIME) if left <= 0 else self._plan(self.network.timeline.now + left)
        elif self.frozen:
            self._plan(self.network.timeline.now + 0.01)


class Loop(Runner):
    """The real loop, one event at a time, in virtual time; it may die before any effect."""

    def __init__(
        self,
        process: Process,
        machine: m.Machine,
        journal: Journal | None,
        store: Store | None,
        log: LogPublisher | None,
    ):
        super().__init__(process, machine, store, log, clock=lambda: process.network.timeline.now)
        self._process, self._journal = process, journal

    def carry(self, effect: m.Effect) -> None:
        process = self._process
        if process.kill_in is not None:
            process.kill_in -= 1
            if process.kill_in < 0:
                self._tear(effect)
                raise Killed
        if not isinstance(effect, (m.Say, m.Warn)):
            super().carry(effect)
        process.carried(process, effect)

    def _tear(self, effect: m.Effect) -> None:
        """A process that dies while it writes an entry leaves a part of it."""
        journal, share = self._journal, self._process.tear
        if share is None or journal is None or not isinstance(effect, m.Append) or not journal.kept:
            return
        before = journal.path.stat().st_size
        super().carry(effect)
        written = journal.path.stat().st_size - before
        with journal.path.open("r+b") as file:
            file.truncate(before + int(written * share))

    def drop(self) -> None:
        """The operating system closes what the process had open."""
        if self._journal is not None:
            self._journal.close()
