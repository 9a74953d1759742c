"""A world behind the bus: the environment sits down on the driver's seat, as an agent does."""

import time
import weakref
from collections.abc import Callable
from contextlib import ExitStack

from gymnasium.error import Error
from phototaxis.bus import Bus, Event
from phototaxis.component import made_up
from phototaxis.errors import UserError
from phototaxis.messages import Command, Control, End, Readings
from phototaxis.session import BusOptions, open_session

SEEK_EVERY = 0.2


class There:
    """A running system: simulation and sensors, and whoever records and watches.

    Parameters
    ----------
    connect : "local" for the sockets of this machine, a Zenoh endpoint as tcp/HOST:7447, or a Zenoh
        configuration file (.json5) for a guarded router.
    world : name of the world on the bus.
    timeout : seconds to wait for an answer.

    Raises
    ------
    gymnasium.error.Error
        here and in every call: when nobody answers in time, or somebody else has taken the seat.
    """

    pose = None

    def __init__(self, connect: str, world: str, timeout: float):
        self._present: set[str] = set()
        self._timeout, self._where = timeout, f"the world '{world}' ({connect})"
        options = BusOptions(name=world)
        if connect.endswith(".json5"):
            options.zenoh_config = connect
        elif connect != "local":
            options.connect = [connect]
        ident = made_up("gymnasium")
        with ExitStack() as stack:
            try:
                session = stack.enter_context(open_session("agent", options, ident))
            except UserError as error:
                raise Error(str(error)) from None
            self._bus = stack.enter_context(Bus(session, world, "agent", ident))
            deadline = time.monotonic() + timeout
            while "sim" not in self._present and (left := deadline - time.monotonic()) > 0:
                self._notice(self._bus.receive(timeout=left))
            found = self._bus.ask_one("world", timeout=timeout) if "sim" in self._present else None
            if found is None:
                raise Error(f"no simulation answers in {self._where}; start one: phototaxis up --epochs 0")
            self.arena = found.arena
            self._closing = weakref.finalize(self, stack.pop_all().close)
        self._now: Readings | None = None
        self._sought_at = 0.0

    def begin(self, seed: int) -> Readings:
        """A run with this seed; whoever drives is asked to hand over first."""
        self._sit()
        reply = self._bus.control(Control("begin", self._bus.ident, seed=seed), timeout=self._timeout)
        if reply is None or not reply.ok:
            raise Error(f"{self._where} does not begin anew: {reply.reason if reply else 'no answer'}")
        self._now = self._hear(lambda readings: readings.run == reply.status.run)
        return self._now

    def drive(self, left: float, right: float) -> Readings:
        return self._answer(left, right, "")

    def place(self, end: End) -> Readings:
        return self._answer(0.0, 0.0, end)

    def close(self) -> None:
        """Leave the seat and the bus."""
        if self._closing.alive:
            self._bus.control(Control("release", self._bus.ident), timeout=0.5)
            self._closing()

    def _answer(self, left: float, right: float, end: End) -> Readings:
        """Answer the present tick; the readings of the next."""
        before = self._now
        if before is None or not self._closing.alive:
            raise Error("the environment is closed" if before else "reset() comes before step()")
        command = Command(before.run, before.tick, self._bus.ident, left, right, end)
        self._bus.put("command", command)
        self._now = self._hear(
            lambda readings: readings.run == before.run and readings.tick > before.tick,
            lambda readings: self._bus.put("command", command) if readings.tick == before.tick else None,
        )
        return self._now

    def _sit(self) -> None:
        """Take the seat, if it is not ours."""

        def seek(_: object = None) -> None:
            if time.monotonic() >= self._sought_at:
                self._sought_at = time.monotonic() + SEEK_EVERY
                self._bus.control(Control("take over", self._bus.ident))

        self._sought_at = 0.0
        seek()
        self._hear(lambda readings: readings.driver == self._bus.ident, seek, seated=False)

    def _hear(
        self,
        wanted: Callable[[Readings], bool],
        otherwise: Callable[[Readings], object] = lambda _: None,
        seated: bool = True,
    ) -> Readings:
        """The first readings that are wanted; what else comes goes to `otherwise`."""
        deadline = time.monotonic() + self._timeout
        while (left := deadline - time.monotonic()) > 0:
            event = self._bus.receive(timeout=left)
            self._notice(event)
            if event is not None and event.topic == "readings":
                readings: Readings = event.message
                if seated and readings.driver != self._bus.ident:
                    raise Error(f"{readings.driver or 'nobody'} holds the seat now; reset(seed=…) takes it back")
                if wanted(readings):
                    return readings
                otherwise(readings)
        missing = [role for role in ("sim", "sensors") if role not in self._present]
        why = f"{' and '.join(missing)} not there" if missing else "though all are there"
        raise Error(f"no readings within {self._timeout:g} s from {self._where}: {why}")

    def _notice(self, event: Event | None) -> None:
        """Who is there."""
        if event is not None and event.topic in ("alive", "gone"):
            (self._present.add if event.topic == "alive" else self._present.discard)(event.message[0])
