"""Where an environment's robot is: in this process, or behind the bus; one interface for both."""

from typing import Protocol

from phototaxis.arena import Arena
from phototaxis.messages import End, Readings
from phototaxis_sensors.suite import SensorSuite
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
