"""Connects an environment to a running system: it takes the driver's seat, as an agent does."""

import time
import weakref
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

from gymnasium.error import ClosedEnvironmentError, Error, ResetNeeded
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.component import unique_name
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.machine import Ask, Effect, Event
from phototaxis.runtime.options import convert
from phototaxis.runtime.seat_client import Place, SeatClient
from phototaxis.runtime.session import BusOptions, bus_location, open_session
from phototaxis.wire.messages import BatchCommand, Command, Control, ControlReply, World
from phototaxis.wire.topics import step_topics

CONFIG_SUFFIXES = (".json5", ".json", ".yaml", ".yml")
"""File name endings by which `connect` is a Zenoh configuration file."""


class Link:
    """Holds the driver's seat of a running system, and drives its robots.

    Parameters
    ----------
    connect : "local" for the sockets of this machine, a Zenoh endpoint such as tcp/HOST:7447, or a Zenoh
        configuration file (.json5, .json, .yaml) for a guarded router.
    world : name of the world on the bus.
    timeout : seconds to wait for an answer.

    Raises
    ------
    gymnasium.error.Error
        here and in every method: when no answer comes in time, or somebody else has taken the seat.
    """

    def __init__(self, connect: str, world: str, timeout: float):
        self._present: set[str] = set()
        self._timeout = timeout
        try:
            options = convert(BusOptions, {"name": world})
        except UserError:
            raise Error(f"world '{world}': up to 40 letters, digits, '_', '.' and '-'") from None
        if connect.endswith(CONFIG_SUFFIXES):
            options.zenoh_config = connect
        elif connect != "local":
            options.connect = [connect]
        self._where = f"the world '{world}' {bus_location(options)}"
        ident = unique_name("gymnasium")
        self._seat = SeatClient(ident)
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
            self.world: World = found
            self._topics = step_topics(found.robots)
            self._closing = weakref.finalize(self, stack.pop_all().close)
        self._now: Any = None

    @property
    def ident(self) -> str:
        """Our name on the bus."""
        return self._bus.ident

    @property
    def tick(self) -> int:
        """The tick of the newest readings."""
        return self._now.tick

    def begin(self, seed: int) -> Any:
        """Take over the seat, begin a run with this seed, and return its first readings."""
        self._check_open()
        self._sit()
        reply = self._bus.control(Control(verb="begin", agent=self.ident, seed=seed), timeout=self._timeout)
        if reply is None or not reply.ok:
            raise Error(f"{self._where} does not begin a new run: {reply.reason if reply else 'no answer'}")
        self._now = None
        self._now = self._hear(lambda readings: readings.run == reply.status.run)
        return self._now

    def answer(self, make: Callable[[str, int], Command | BatchCommand]) -> Any:
        """Answer the newest tick, and return the first readings after the command was applied.

        `make` makes the command from the name of the run and the number of the tick. In lockstep the next tick has
        applied it. In real time the world does not wait: readings that came meanwhile are skipped, and a command that
        came too late is sent again.
        """
        self._check_open()
        if self._now is None:
            raise ResetNeeded("call reset(seed=…) first")
        self._catch_up()
        before, topic = self._now, self._topics.command
        command = make(before.run, before.tick)
        self._bus.put(topic, command)
        self._now = self._hear(
            lambda readings: readings.run == before.run and _obeyed(command, before, readings),
            lambda readings: self._bus.put(topic, make(before.run, readings.tick)),
        )
        return self._now

    def close(self) -> None:
        """Leave the seat and the bus."""
        if self._closing.alive:
            self._carry(self._seat.leave())
            self._closing()

    def __reduce__(self) -> Any:
        raise TypeError(
            f"an environment of {self._where} cannot be copied or pickled: it holds the driver's seat there, and there "
            f"is only one seat; make another environment, or one without connect"
        )

    def _check_open(self) -> None:
        if not self._closing.alive:
            raise ClosedEnvironmentError("the environment is closed; make another one")

    def _catch_up(self) -> None:
        """Move on to the newest readings that have come."""
        while (event := self._bus.receive(timeout=0)) is not None:
            self._notice(event)
            if event.topic == self._topics.readings and event.message.run == self._now.run:
                self._now = event.message

    def _sit(self) -> None:
        """Take the seat if it is not ours. The reply counts too, since a finished run publishes no readings."""
        reply = self._carry(self._seat.want("take over", time.monotonic()), self._timeout)
        if reply is not None and reply.status.driver == self.ident:
            self._seat.seated()
        else:
            self._hear(lambda _: self._seat.place is Place.DRIVING, seated=False)

    def _carry(self, effects: Sequence[Effect], timeout: float = 0.0) -> ControlReply | None:
        """Send the seat client's requests to the simulation, and return the last reply.

        Each waits `timeout` seconds; 0: as long as the request says.
        """
        reply = None
        for ask in effects:
            if isinstance(ask, Ask) and isinstance(ask.request, Control):
                reply = self._bus.control(ask.request, timeout or ask.timeout)
                self._seat.answered(reply)
        return reply

    def _hear(
        self,
        wanted: Callable[[Any], bool],
        otherwise: Callable[[Any], object] = lambda _: None,
        seated: bool = True,
    ) -> Any:
        """Wait for the first readings that `wanted` accepts, and return them; call `otherwise` with the others.

        With `seated`, readings of another driver or of a run that somebody else has begun are an error.
        """
        deadline = time.monotonic() + self._timeout
        while (left := deadline - time.monotonic()) > 0:
            event = self._bus.receive(timeout=left)
            self._notice(event)
            if event is None or event.topic != self._topics.readings:
                continue
            readings = event.message
            seeks = self._seat.see(readings, time.monotonic())
            if seated:
                self._check_ours(readings)
            self._carry(seeks)  # a restarted simulation has no driver: claim the seat, and wait until readings name us
            if seated and not readings.driver:
                continue
            if wanted(readings):
                return readings
            otherwise(readings)
        raise Error(f"no readings within {self._timeout:g} s from {self._where}: {self._why()}")

    def _check_ours(self, readings: Any) -> None:
        """Raise Error when somebody else drives, or has begun a new run."""
        if readings.driver not in ("", self.ident):
            raise Error(f"{readings.driver} holds the seat now; reset(seed=…) takes it back")
        if self._now is not None and readings.run != self._now.run:
            self._now = readings
            raise Error(
                f"somebody else has begun a new run ({readings.run}) in {self._where}; reset() goes on in it, "
                f"reset(seed=…) begins one of your own"
            )

    def _why(self) -> str:
        """Say why no readings come, from what is on the bus and from the simulation's status."""
        if missing := [role for role in ("sim", "sensors") if role not in self._present]:
            return f"{' and '.join(missing)} not on the bus"
        reply = self._bus.control(Control(verb="status"))
        if reply is None:
            return "the simulation is on the bus, but does not answer"
        status = reply.status
        if status.phase == "paused":
            return f"it is paused; to continue: phototaxis control resume --name {self._bus.name}"
        if status.phase == "finished":
            own = status.driver in ("", self.ident)
            again = "reset(seed=…)" if own else f"phototaxis control begin --name {self._bus.name}"
            return f"its run is finished; {again} begins another"
        if status.driver not in ("", self.ident):
            return f"{status.driver} holds the seat and has not answered for {status.waited:.1f} s"
        return f"it waits for {status.waiting_for}" if status.waiting_for else "although all components are on the bus"

    def _notice(self, event: Event | None) -> None:
        """Note who is on the bus; a simulation that restarts may not know that we hold the seat."""
        if event is not None and event.topic in ("alive", "gone"):
            (self._present.add if event.topic == "alive" else self._present.discard)(event.message[0])
            if event.message[0] == "sim":
                self._seat.simulation_is_back()


def _obeyed(command: Any, before: Any, now: Any) -> bool:
    """Whether the readings `now` come after the command was applied: they repeat its motors, or begin new episodes."""
    if now.tick <= before.tick:
        return False
    return now.episode != before.episode if any(command.end) else (now.left, now.right) == (command.left, command.right)


def refuse_poses(starts: object) -> None:
    """Raise ValueError if the user gives a pose."""
    if starts:
        raise ValueError("options['pose']: a running system places its robots itself; leave it out with connect")
