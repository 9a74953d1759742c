"""Runs a machine on the bus: one event in, its effects out, in order."""

import math
import sys
import time
from collections.abc import Callable
from typing import Any, Protocol

from phototaxis.runtime import machine as m
from phototaxis.runtime.chunks import LogPublisher
from phototaxis.runtime.errors import warn
from phototaxis.runtime.store import Store
from phototaxis.wire.messages import Message

MAX_WAIT_S = 1.0
"""The longest wait for an event, so that signals are handled on every system."""


class Bus(Protocol):
    """The part of `phototaxis.runtime.bus.Bus` that the loop uses."""

    ident: str

    def receive(self, timeout: float) -> m.Event | None: ...
    def put(self, topic: str, message: Message | bytes) -> None: ...
    def ask_aside(self, ask: m.Ask) -> None: ...
    def listen(self, topic: str, wanted: bool) -> None: ...
    def refuse(self, topic: str, why: str) -> None: ...


class Runner:
    """The loop of every component.

    Parameters
    ----------
    bus : the component's connection to the bus.
    machine : decides what happens.
    store : writes its journal and checkpoint; None for a component without files.
    log : publishes the rows that it records; None for a component without a log.
    clock : seconds of a monotonic clock.
    own : carries out the effects that only this machine has.
    """

    def __init__(
        self,
        bus: Bus,
        machine: m.Machine,
        store: Store | None = None,
        log: LogPublisher | None = None,
        clock: Callable[[], float] = time.monotonic,
        own: Callable[[m.Own], object] | None = None,
    ):
        self._bus, self._machine, self._store, self._log = bus, machine, store or Store(), log
        self._clock, self.running = clock, True
        self._carry: dict[type[Any], Callable[[Any], object]] = {
            m.Publish: lambda e: bus.put(e.topic, e.message),
            m.Reply: lambda e: e.to(e.message),
            m.Ask: bus.ask_aside,
            m.Listen: lambda e: bus.listen(e.topic, e.wanted),
            m.Refuse: lambda e: bus.refuse(e.topic, e.why),
            m.Say: lambda e: print(f"{bus.ident}: {e.text}", file=sys.stderr, flush=True),
            m.Warn: lambda e: warn(f"{bus.ident}: {e.text}"),
            m.Begin: self._write,
            m.Append: self._write,
            m.Save: self._write,
            m.Record: lambda e: log and log.add(e.head, e.row, self._clock()),
            m.Flush: lambda _: log and log.flush(),
            m.Stop: self._stop,
        }
        self._own = own

    def run(self) -> None:
        """Run until the machine stops.

        Raises
        ------
        Unavailable
            when the last checkpoint cannot be written.
        """
        self.handle(m.START)
        while self.running:
            self.handle(self._bus.receive(self.wait()) or m.TIME)
        self.finish()

    def finish(self) -> None:
        """Publish the waiting log rows after the machine has stopped; raises as `run` does."""
        if self._log is not None:
            self._log.flush()
        if self._store.fault is not None:
            raise self._store.fault

    def handle(self, event: m.Event) -> None:
        """Give the machine one event and carry out its effects."""
        if self._log is not None and event.topic == self._log.topic:
            self._log.answer(event)
            return
        for effect in self._machine.on(event, self._clock()):
            self.carry(effect)
        if self._log is not None:
            self._log.poll(self._clock())

    def carry(self, effect: m.Effect) -> None:
        """Carry out one effect."""
        if isinstance(effect, m.Own) and self._own is not None:
            self._own(effect)
        else:
            self._carry[type(effect)](effect)

    def _write(self, effect: m.Begin | m.Append | m.Save) -> None:
        fault = self._store.carry(effect)
        if fault is not None:
            self.handle(m.Event("write_failure", fault))

    def _stop(self, _: m.Stop) -> None:
        self.running = False

    def wait(self) -> float:
        """Seconds to wait for an event before a deadline of the machine or the log comes."""
        waiting = math.inf if self._log is None else self._log.deadline
        return min(max(min(self._machine.deadline, waiting) - self._clock(), 0.0), MAX_WAIT_S)
