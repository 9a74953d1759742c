"""A world behind the bus: the environment sits down on the driver's seat, as an agent does."""

import time
import weakref
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any, Literal

import msgspec
import numpy as np
from gymnasium.error import Error
from phototaxis.bus import Bus, Event
from phototaxis.codec import Refused
from phototaxis.columns import FLAG, pack, unpack
from phototaxis.component import made_up
from phototaxis.errors import UserError
from phototaxis.messages import Command, CommandOfMany, Control, End, Readings, ReadingsOfMany, Seed, World
from phototaxis.options import convert
from phototaxis.session import BusOptions, open_session
from phototaxis.task import CrowdReadings

SEEK_EVERY = 0.2


class Link:
    """The driver's seat of a running system: simulation and sensors, and whoever records and watches.

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

    def __init__(self, connect: str, world: str, timeout: float):
        self._present: set[str] = set()
        self._timeout, self._where = timeout, f"the world '{world}' ({connect})"
        try:
            options = convert(BusOptions, {"name": world})
        except UserError:
            raise Error(f"world '{world}': up to 40 letters, digits, '_', '.' and '-'") from None
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
            self.world: World = found
            self._prefix = "crowd/" if found.robots > 1 else ""
            self._closing = weakref.finalize(self, stack.pop_all().close)
        self._now: Any = None
        self._sought_at = 0.0

    @property
    def ident(self) -> str:
        """Our name on the bus."""
        return self._bus.ident

    def begin(self, seed: int) -> Any:
        """The first readings of a run with this seed; whoever drives is asked to hand over first."""
        try:
            msgspec.convert(seed, Seed)
        except msgspec.ValidationError as error:
            raise Error(f"seed {seed}: {error}") from None
        self._sit()
        reply = self._bus.control(Control("begin", self.ident, seed=seed), timeout=self._timeout)
        if reply is None or not reply.ok:
            raise Error(f"{self._where} does not begin anew: {reply.reason if reply else 'no answer'}")
        self._now = self._hear(lambda readings: readings.run == reply.status.run)
        return self._now

    def answer(self, make: Callable[[str, int], Command | CommandOfMany]) -> Any:
        """Answer the newest tick with what `make` makes of its run and number; the first readings that show it obeyed.

        In lockstep those are the next tick's. In real time the world does not wait: what came while nobody was
        listening is passed over, and an answer that came late is given again.
        """
        if self._now is None or not self._closing.alive:
            raise Error("the environment is closed" if self._now else "reset() comes before step()")
        self._catch_up()
        before, topic = self._now, f"{self._prefix}command"
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
            self._bus.control(Control("release", self.ident), timeout=0.5)
            self._closing()

    def _catch_up(self) -> None:
        """The newest readings that have come."""
        while (event := self._bus.receive(timeout=0)) is not None:
            self._notice(event)
            if event.topic == f"{self._prefix}readings" and event.message.run == self._now.run:
                self._now = event.message

    def _sit(self) -> None:
        """Take the seat, if it is not ours."""
        self._seek("take over")
        self._hear(lambda readings: readings.driver == self.ident, lambda _: self._seek("take over"), seated=False)

    def _seek(self, verb: Literal["claim", "take over"]) -> None:
        """Ask for the seat, now and then."""
        if time.monotonic() >= self._sought_at:
            self._sought_at = time.monotonic() + SEEK_EVERY
            self._bus.control(Control(verb, self.ident))

    def _hear(
        self,
        wanted: Callable[[Any], bool],
        otherwise: Callable[[Any], object] = lambda _: None,
        seated: bool = True,
    ) -> Any:
        """The first readings that are wanted; what else comes goes to `otherwise`."""
        deadline = time.monotonic() + self._timeout
        while (left := deadline - time.monotonic()) > 0:
            event = self._bus.receive(timeout=left)
            self._notice(event)
            if event is not None and event.topic == f"{self._prefix}readings":
                readings = event.message
                if seated and readings.driver not in ("", self.ident):
                    raise Error(f"{readings.driver} holds the seat now; reset(seed=…) takes it back")
                if seated and not readings.driver:  # a simulation that is back: once seated we learn what it obeyed
                    self._seek("claim")
                elif wanted(readings):
                    return readings
                else:
                    otherwise(readings)
        missing = [role for role in ("sim", "sensors") if role not in self._present]
        why = f"{' and '.join(missing)} not there" if missing else "though all are there"
        raise Error(f"no readings within {self._timeout:g} s from {self._where}: {why}")

    def _notice(self, event: Event | None) -> None:
        """Who is there."""
        if event is not None and event.topic in ("alive", "gone"):
            (self._present.add if event.topic == "alive" else self._present.discard)(event.message[0])


def _obeyed(command: Any, before: Any, now: Any) -> bool:
    """Whether `now` comes after the command was applied: its echo, or new episodes where it ended some."""
    if now.tick <= before.tick:
        return False
    return now.episode != before.episode if any(command.end) else (now.left, now.right) == (command.left, command.right)


class There:
    """One robot behind the bus."""

    pose = None

    def __init__(self, connect: str, world: str, timeout: float):
        self._link = Link(connect, world, timeout)
        self.arena = self._link.world.arena
        if self._link.world.robots > 1:
            self._link.close()
            raise Error(f"the world '{world}' has {self._link.world.robots} robots: gymnasium.make_vec drives them")

    def begin(self, seed: int) -> Readings:
        """A new run with this seed."""
        return self._link.begin(seed)

    def drive(self, left: float, right: float) -> Readings:
        return self._link.answer(lambda run, tick: Command(run, tick, self._link.ident, left, right))

    def place(self, end: End) -> Readings:
        return self._link.answer(lambda run, tick: Command(run, tick, self._link.ident, 0.0, 0.0, end))

    def close(self) -> None:
        """Leave the seat and the bus."""
        self._link.close()


class ManyThere:
    """N robots behind the bus."""

    poses = None

    def __init__(self, connect: str, world: str, timeout: float, count: int):
        self._link, self._count = Link(connect, world, timeout), count
        self.arena = self._link.world.arena
        if self._link.world.robots != count or count == 1:
            self._link.close()
            why = "one robot is for gymnasium.make" if count == 1 else f"start it with --robots {count}"
            raise Error(f"the world '{world}' has {self._link.world.robots} robots, num_envs is {count}; {why}")

    def begin(self, seeds: Sequence[int]) -> CrowdReadings:
        """A new run; the seeds must follow one another."""
        if list(seeds) != list(range(seeds[0], seeds[0] + self._count)):
            raise Error("behind the bus the robots' seeds are S, S + 1, S + 2, …: give reset one number")
        return self._senses(self._link.begin(seeds[0]))

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> CrowdReadings:
        columns = pack(motors[0]), pack(motors[1]), pack(ends, FLAG)
        return self._senses(self._link.answer(lambda run, tick: CommandOfMany(run, tick, self._link.ident, *columns)))

    def close(self) -> None:
        """Leave the seat and the bus."""
        self._link.close()

    def _senses(self, readings: ReadingsOfMany) -> CrowdReadings:
        try:
            sonar, light = unpack(readings.sonar, self._count, 16), unpack(readings.light, self._count, 2)
            front, rear = unpack(readings.contact, self._count, 2, FLAG).astype(bool)
        except Refused as why:
            raise Error(f"the sensors' readings cannot be used: {why}") from None
        return CrowdReadings(sonar, light, front, rear)
