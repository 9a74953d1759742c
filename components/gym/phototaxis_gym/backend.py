"""The worlds behind the environments: one interface, with an implementation in this process and one on the bus."""

from array import array
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from phototaxis.geometry.arena import Arena
from phototaxis.task import BatchObservation
from phototaxis.wire.messages import End, Readings
from phototaxis_sensors.batch_suite import BatchSuite
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim.batch_simulation import BatchSimulation
from phototaxis_sim.physics import Pose
from phototaxis_sim.simulation import Simulation

AUTHOR = "gymnasium"
"""Name of the driver in a local world."""


class Backend(Protocol):
    """A world with one robot. The same seeds and commands give the same readings in every implementation."""

    @property
    def arena(self) -> Arena: ...
    @property
    def pose(self) -> Pose | None:
        """The robot's pose (x, y in m, heading in rad); None on the bus, where a driver does not know it."""
        ...

    def begin(self, seed: int, start: Pose | None = None) -> Readings:
        """Begin a run with this seed, and return its first readings; `start` replaces the pose that the seed gives."""
        ...

    def drive(self, left: float, right: float) -> Readings:
        """Hold the wheel commands, −1..1, for one control period, and return the next readings."""
        ...

    def place(self, end: End, start: Pose | None = None) -> Readings:
        """End the episode for the reason `end`, and return the first readings of the next one."""
        ...

    def close(self) -> None:
        """Leave the world."""


class BatchBackend(Protocol):
    """A world with N robots. N is the last axis of observations."""

    @property
    def arena(self) -> Arena: ...
    @property
    def poses(self) -> np.ndarray | None:
        """The poses (x, y in m, heading in rad), shape (N, 3); None on the bus, where a driver does not know them."""
        ...

    @property
    def tick(self) -> int:
        """The tick of the newest readings."""
        ...

    def begin(self, seeds: Sequence[int], starts: Mapping[int, Pose]) -> BatchObservation:
        """Begin a run in which robot i has the placements of `seeds[i]`, or starts at `starts[i]`."""
        ...

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> BatchObservation:
        """Hold motors (2, N) for one control period.

        A robot with an end (an index into `ENDS` that is not 0) does not drive, but begins a new episode.
        """
        ...

    def renew(self, ends: np.ndarray, seeds: Mapping[int, int], starts: Mapping[int, Pose]) -> BatchObservation:
        """Begin new episodes of the robots with an end while the others wait.

        `seeds` gives some of them a new seed, and `starts` gives some of them a pose.
        """
        ...

    def close(self) -> None:
        """Leave the world."""


class LocalBatchBackend:
    """N robots in this process.

    It can be copied and pickled. A copied pymunk space does not continue exactly like the original, so a copy places
    each robot where its episode began and repeats its commands, as the simulation on the bus does with its journal.
    """

    def __init__(self, arena: Arena):
        self.arena = arena
        self.poses: np.ndarray | None = None

    def begin(self, seeds: Sequence[int], starts: Mapping[int, Pose]) -> BatchObservation:
        self._seeds, self._noise_seed = list(seeds), seeds[0]
        self._simulation = BatchSimulation(self.arena, seeds[0], AUTHOR, 0, len(seeds), seeds, starts)
        self._suite = BatchSuite(self._simulation.world)
        self._starts, self._ages = self._simulation.poses.copy(), np.zeros(len(seeds), int)
        self._journal: deque[np.ndarray] = deque()
        return self._sense()

    @property
    def tick(self) -> int:
        return self._simulation.tick

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> BatchObservation:
        self._simulation.drive(motors, ends)
        self._journal.append(motors)
        self._ages += 1
        return self._placed(ends > 0)

    def renew(self, ends: np.ndarray, seeds: Mapping[int, int], starts: Mapping[int, Pose]) -> BatchObservation:
        rows = np.flatnonzero(ends)
        for row in rows.tolist():
            self._seeds[row] = seeds.get(row, self._seeds[row])
            self._simulation.expect(row, seeds.get(row), starts.get(row))
        self._simulation.renew(rows)
        return self._placed(ends > 0)

    def close(self) -> None:
        """Nothing is held."""

    def _placed(self, fresh: np.ndarray) -> BatchObservation:
        """Note which episodes have begun, and drop commands that no running episode needs; return the observation."""
        self._ages[fresh] = 0
        self._starts[fresh] = self._simulation.poses[fresh]
        while len(self._journal) > self._ages.max():
            self._journal.popleft()
        return self._sense()

    def _sense(self) -> BatchObservation:
        simulation = self._simulation
        self.poses = simulation.poses
        return BatchObservation(*self._suite(simulation.tick, simulation.poses), simulation.front, simulation.rear)

    def __getstate__(self) -> dict[str, Any]:
        kept = {name: value for name, value in vars(self).items() if name not in ("_simulation", "_suite")}
        if self.poses is None:
            return kept
        return {**kept, "_at": (self._simulation.tick, self._simulation.episode.copy())}

    def __setstate__(self, state: dict[str, Any]) -> None:
        at = state.pop("_at", None)
        self.__dict__.update(state)
        if at is None:
            return
        starts = [Pose(*pose) for pose in self._starts.tolist()]
        simulation = BatchSimulation(
            self.arena, self._noise_seed, AUTHOR, 0, len(starts), self._seeds, dict(enumerate(starts))
        )
        for left, motors in zip(range(len(self._journal), 0, -1), self._journal, strict=True):
            fresh = np.flatnonzero(self._ages == left)
            for row in fresh.tolist():
                simulation.expect(row, start=starts[row])
            simulation.renew(fresh)
            simulation.drive(np.where(self._ages >= left, motors, 0.0), np.zeros(len(starts), np.uint8))
        simulation.tick, simulation.episode = at
        self._simulation, self._suite = simulation, BatchSuite(simulation.world)
        self.poses = simulation.poses


class LocalBackend:
    """A world in this process; it can be copied and pickled as `LocalBatchBackend` can."""

    def __init__(self, arena: Arena):
        self.arena = arena
        self._run(Simulation(arena, 0, AUTHOR))

    @property
    def pose(self) -> Pose:
        state = self._simulation.state
        return Pose(state.x, state.y, state.heading)

    def begin(self, seed: int, start: Pose | None = None) -> Readings:
        return self._run(Simulation(self.arena, seed, AUTHOR, start=start), start)

    def drive(self, left: float, right: float) -> Readings:
        self._commands.extend((left, right))
        return self._suite(self._simulation.advance(left, right, AUTHOR))

    def place(self, end: End, start: Pose | None = None) -> Readings:
        self._simulation.advance(0.0, 0.0, AUTHOR, end, start)
        return self._episode(start)

    def close(self) -> None:
        """Nothing is held."""

    def _run(self, simulation: Simulation, start: Pose | None = None) -> Readings:
        self._simulation, self._suite = simulation, SensorSuite(simulation.world)
        return self._episode(start)

    def _episode(self, start: Pose | None) -> Readings:
        """Note how an episode begins, to repeat it in a copy; return its first readings."""
        self._start, self._commands = start, array("d")
        self._began = self._simulation.snapshot([], "")
        return self._suite(self._simulation.state)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("_simulation", "_suite")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        simulation = Simulation(self.arena, self._began.seed, AUTHOR)
        simulation.restore(self._began, self._start)
        for left, right in zip(self._commands[::2], self._commands[1::2], strict=True):
            simulation.advance(left, right, AUTHOR)
        self._simulation, self._suite = simulation, SensorSuite(simulation.world)
