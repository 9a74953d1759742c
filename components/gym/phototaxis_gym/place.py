"""Where an environment's robot is: in this process, or behind the bus; one interface for both."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from phototaxis.arena import Arena
from phototaxis.messages import End, Readings
from phototaxis.task import CrowdReadings
from phototaxis_sensors.crowd import CrowdSuite
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim.many import SimulationOfMany
from phototaxis_sim.simulation import Simulation

Pose = tuple[float, float, float]


class Place(Protocol):
    """A world with one robot, tick by tick. The same seeds and commands give the same readings in all of them."""

    @property
    def arena(self) -> Arena: ...
    @property
    def pose(self) -> Pose | None:
        """x, y in m and the heading in rad; None where a robot's driver is not told."""
        ...

    def begin(self, seed: int) -> Readings:
        """A run with this seed, at its first tick."""
        ...

    def drive(self, left: float, right: float) -> Readings:
        """Hold the wheel commands, −1..1, for one control period."""
        ...

    def place(self, end: End) -> Readings:
        """End the episode (`end` says why) and begin the run's next one."""
        ...

    def close(self) -> None:
        """Leave the world."""


class Places(Protocol):
    """A world with N robots. Columns have N as their last axis."""

    @property
    def arena(self) -> Arena: ...
    @property
    def poses(self) -> np.ndarray | None:
        """(N, 3); None where the driver is not told."""
        ...

    def begin(self, seeds: Sequence[int]) -> CrowdReadings:
        """A run in which robot i is placed as with `seeds[i]`."""
        ...

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> CrowdReadings:
        """Hold motors (2, N); robots with an end (index into `ENDS`, not 0) are placed anew instead."""
        ...

    def close(self) -> None:
        """Leave the world."""


class ManyHere:
    """N robots in this process."""

    def __init__(self, arena: Arena):
        self.arena = arena
        self.poses: np.ndarray | None = None

    def begin(self, seeds: Sequence[int]) -> CrowdReadings:
        self._simulation = SimulationOfMany(self.arena, seeds[0], "gymnasium", robots=len(seeds), seeds=seeds)
        self._suite = CrowdSuite(self._simulation.world)
        return self._sense()

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> CrowdReadings:
        self._simulation.drive(motors, ends)
        return self._sense()

    def close(self) -> None:
        """Nothing is held."""

    def _sense(self) -> CrowdReadings:
        simulation = self._simulation
        self.poses = simulation.poses
        return CrowdReadings(*self._suite(simulation.tick, simulation.poses), simulation.front, simulation.rear)


class Here:
    """A world in this process."""

    def __init__(self, arena: Arena):
        self.arena = arena
        self._simulation = Simulation(arena, 0, "gymnasium")
        self._suite = SensorSuite(self._simulation.world)

    @property
    def pose(self) -> Pose:
        state = self._simulation.state
        return state.x, state.y, state.heading

    def begin(self, seed: int) -> Readings:
        self._simulation = Simulation(self.arena, seed, "gymnasium")
        self._suite = SensorSuite(self._simulation.world)
        return self._suite(self._simulation.state)

    def drive(self, left: float, right: float) -> Readings:
        return self._suite(self._simulation.advance(left, right, "gymnasium"))

    def place(self, end: End) -> Readings:
        return self._suite(self._simulation.advance(0.0, 0.0, "gymnasium", end))

    def close(self) -> None:
        """Nothing is held."""
