"""A world behind the bus: the environment sits down on the driver's seat, as an agent does."""

import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, Literal

import numpy as np
from gymnasium.error import ClosedEnvironmentError, Error, ResetNeeded
from phototaxis.bus import Bus, Event
from phototaxis.codec import Refused
from phototaxis.columns import FLAG, pack, unpack
from phototaxis.component import made_up
from phototaxis.errors import UserError
from phototaxis.messages import Command, CommandOfMany, Control, End, Readings, ReadingsOfMany, World
from phototaxis.options import convert
from phototaxis.session import BusOptions, open_session, place
from phototaxis.task import BatchObservation
from phototaxis_sim.physics import Pose

FILES = (".json5", ".json", ".yaml", ".yml")
"""How the names of Zenoh's configuration files end."""
SEEK_EVERY = 0.2
FOLLOW = "behind the bus the robots' seeds are S, S + 1, S + 2, …"


class Link:
    """The driver's seat of a running system: simulation and sensors, and whoever records and watches.

    Parameters
    ----------
    connect : "local" for the sockets of this machine, a Zenoh endpoint as tcp/HOST:7447, or a Zenoh
        configuration file (.json5, .json, .yaml) for a guarded router.
    world : name of the world on the bus.
    timeout : seconds to wait for an answer.

    Raises
    ------
    gymnasium.error.Error
        here and in every call: when nobody answers in time, or somebody else has taken the seat.
    """

    def __init__(self, connect: str, world: str, timeout: float):
        self._present: set[str] = set()
        self._timeout = timeout
        try:
            options = convert(BusOptions, {"name": world})
        except UserError:
            raise Error(f"world '{world}': up to 40 letters, digits, '_', '.' and '-'") from None
        if connect.endswith(FILES):
            options.zenoh_config = connect
        elif connect != "local":
            options.connect = [connect]
        self._where = f"the world '{world}' {place(options)}"
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

    @property
    def tick(self) -> int:
        """Of the newest readings."""
        return self._now.tick

    def begin(self, seed: int) -> Any:
        """The first readings of a run with this seed; whoever drives is asked to hand over first."""
        self._check_open()
        self._sit()
        reply = self._bus.control(Control("begin", self.ident, seed=seed), timeout=self._timeout)
        if reply is None or not reply.ok:
            raise Error(f"{self._where} does not begin anew: {reply.reason if reply else 'no answer'}")
        self._now = None
        self._now = self._hear(lambda readings: readings.run == reply.status.run)
        return self._now

    def answer(self, make: Callable[[str, int], Command | CommandOfMany]) -> Any:
        """Answer the newest tick with what `make` makes of its run and number; the first readings that show it obeyed.

        In lockstep those are the next tick's. In real time the world does not wait: what came while nobody was
        listening is passed over, and an answer that came late is given again.
        """
        self._check_open()
        if self._now is None:
            raise ResetNeeded("reset(seed=…) comes first")
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

    def __reduce__(self) -> Any:
        raise TypeError(
            f"an environment of {self._where} cannot be copied or pickled: it holds the driver's seat there, and there "
            f"is one; make another, or one without connect"
        )

    def _check_open(self) -> None:
        if not self._closing.alive:
            raise ClosedEnvironmentError("the environment is closed; make another one")

    def _catch_up(self) -> None:
        """The newest readings that have come."""
        while (event := self._bus.receive(timeout=0)) is not None:
            self._notice(event)
            if event.topic == f"{self._prefix}readings" and event.message.run == self._now.run:
                self._now = event.message

    def _sit(self) -> None:
        """Take the seat, if it is not ours. A finished run sends no readings that could show whose it is."""
        self._sought_at = time.monotonic()
        reply = self._bus.control(Control("take over", self.ident), timeout=self._timeout)
        if reply is not None and reply.status.driver == self.ident:
            return
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
        """The first readings that are wanted; what else comes goes to `otherwise`.

        Once a run is under way, one that somebody else began in its place is an error.
        """
        deadline = time.monotonic() + self._timeout
        while (left := deadline - time.monotonic()) > 0:
            event = self._bus.receive(timeout=left)
            self._notice(event)
            if event is not None and event.topic == f"{self._prefix}readings":
                readings = event.message
                if seated and readings.driver not in ("", self.ident):
                    raise Error(f"{readings.driver} holds the seat now; reset(seed=…) takes it back")
                if seated and self._now is not None and readings.run != self._now.run:
                    self._now = readings
                    raise Error(
                        f"somebody else has begun a new run ({readings.run}) in {self._where}; reset() goes on in it, "
                        f"reset(seed=…) begins one of your own"
                    )
                if seated and not readings.driver:  # a simulation that is back: once seated we learn what it obeyed
                    self._seek("claim")
                elif wanted(readings):
                    return readings
                else:
                    otherwise(readings)
        raise Error(f"no readings within {self._timeout:g} s from {self._where}: {self._why()}")

    def _why(self) -> str:
        """Why no readings come, as far as the simulation can tell."""
        if missing := [role for role in ("sim", "sensors") if role not in self._present]:
            return f"{' and '.join(missing)} not there"
        reply = self._bus.control(Control("status"))
        if reply is None:
            return "the simulation is there, but does not answer"
        status = reply.status
        if status.phase == "paused":
            return f"it is paused; phototaxis control resume --name {self._bus.name} lets it go on"
        if status.phase == "finished":
            own = status.driver in ("", self.ident)
            again = "reset(seed=…)" if own else f"phototaxis control begin --name {self._bus.name}"
            return f"its run is finished; {again} begins another"
        if status.driver not in ("", self.ident):
            return f"{status.driver} holds the seat and has not answered for {status.waited:.1f} s"
        return f"it waits for {status.waiting_for}" if status.waiting_for else "though all are there"

    def _notice(self, event: Event | None) -> None:
        """Who is there."""
        if event is not None and event.topic in ("alive", "gone"):
            (self._present.add if event.topic == "alive" else self._present.discard)(event.message[0])


def _obeyed(command: Any, before: Any, now: Any) -> bool:
    """Whether `now` comes after the command was applied: its echo, or new episodes where it ended some."""
    if now.tick <= before.tick:
        return False
    return now.episode != before.episode if any(command.end) else (now.left, now.right) == (command.left, command.right)


def _refuse_poses(starts: object) -> None:
    if starts:
        raise ValueError("options['pose']: a running system places its robots itself; leave it out with connect")


class There:
    """One robot behind the bus."""

    pose = None

    def __init__(self, connect: str, world: str, timeout: float):
        self._link = Link(connect, world, timeout)
        self.arena = self._link.world.arena
        if self._link.world.robots > 1:
            self._link.close()
            raise Error(f"the world '{world}' has {self._link.world.robots} robots: gymnasium.make_vec drives them")

    def begin(self, seed: int, start: Pose | None = None) -> Readings:
        """A new run with this seed."""
        _refuse_poses(start)
        return self._link.begin(seed)

    def drive(self, left: float, right: float) -> Readings:
        return self._link.answer(lambda run, tick: Command(run, tick, self._link.ident, left, right))

    def place(self, end: End, start: Pose | None = None) -> Readings:
        _refuse_poses(start)
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

    @property
    def tick(self) -> int:
        return self._link.tick

    def begin(self, seeds: Sequence[int], starts: Mapping[int, Pose]) -> BatchObservation:
        """A new run; the seeds must follow one another."""
        _refuse_poses(starts)
        if list(seeds) != list(range(seeds[0], seeds[0] + self._count)):
            raise Error(f"{FOLLOW}: give reset one number")
        return self._senses(self._link.begin(seeds[0]))

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> BatchObservation:
        columns = pack(motors[0]), pack(motors[1]), pack(ends, FLAG)
        return self._senses(self._link.answer(lambda run, tick: CommandOfMany(run, tick, self._link.ident, *columns)))

    def renew(self, ends: np.ndarray, seeds: Mapping[int, int], starts: Mapping[int, Pose]) -> BatchObservation:
        """One tick, in which the others hold still."""
        _refuse_poses(starts)
        if seeds:
            raise Error(f"{FOLLOW}: give reset one number, and no reset_mask")
        return self.drive(np.zeros((2, self._count)), ends)

    def close(self) -> None:
        """Leave the seat and the bus."""
        self._link.close()

    def _senses(self, readings: ReadingsOfMany) -> BatchObservation:
        try:
            sonar, light = unpack(readings.sonar, self._count, 16), unpack(readings.light, self._count, 2)
            front, rear = unpack(readings.contact, self._count, 2, FLAG).astype(bool)
        except Refused as why:
            raise Error(f"the sensors' readings cannot be used: {why}") from None
        return BatchObservation(sonar, light, front, rear)
