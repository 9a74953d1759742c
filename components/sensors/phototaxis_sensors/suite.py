"""The sensor suite: everything the robot senses at one tick."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, TypeVar

from phototaxis.geometry.arena import Arena
from phototaxis.wire.messages import Readings, State, World

from phototaxis_sensors.light import LightModel
from phototaxis_sensors.model import Moment, SensorModel
from phototaxis_sensors.noise import uniform
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.sonar import SonarModel

StateT = TypeVar("StateT", contravariant=True)
ReadingsT = TypeVar("ReadingsT")


class Suite(Protocol[StateT, ReadingsT]):
    """The sensors of a world, whether it has one robot or many."""

    @property
    def stateful(self) -> bool:
        """Whether readings depend on earlier ticks of the episode; then each tick is asked once, in order."""
        ...

    @property
    def names(self) -> tuple[str, str]:
        """Which models make the ranges and the light at present, for the recording."""
        ...

    def __call__(self, state: StateT) -> ReadingsT:
        """Answer one tick.

        Raises
        ------
        Refused
            when the state is not one of this world.
        """
        ...

    def first(self, readings: ReadingsT) -> tuple[list[float], Sequence[float]]:
        """The 16 ranges and 2 lights of the first robot, for the recording."""
        ...

    def follow(self, moment: Moment) -> None:
        """Lead stateful models through a tick that another suite has answered."""
        ...

    def begun_anew(self, tick: int) -> None:
        """Tell stateful models that the ticks of the episode before this one are unknown."""
        ...


class Models(NamedTuple):
    """The models of one robot's sensors."""

    sonar: SensorModel
    light: SensorModel


Make = Callable[[Arena, Scene], Models]


def built_in(arena: Arena, scene: Scene) -> Models:
    """The models that come with the suite: pure functions of the pose."""
    return Models(SonarModel(arena, scene), LightModel(arena, scene))


class SensorSuite:
    """Readings as a function of (world, state): the same state gives the same readings, whenever asked.

    With a model that remembers (an FMU) they depend on the earlier states of the episode, too; each tick
    is then asked once, in order.
    """

    def __init__(self, world: World, make: Make = built_in):
        arena = world.arena
        self._seed, self._noise, self._range = world.seed, arena.sensing.noise, arena.robot.sonar_range
        self._models = make(arena, Scene(arena))
        self.stateful = any(model.stateful for model in self._models)

    @property
    def names(self) -> tuple[str, str]:
        sonar, light = self._models
        return sonar.name, light.name

    def __call__(self, state: State) -> Readings:
        """Answer one tick."""
        sonar = list(self._models.sonar(state))
        left, right = self._models.light(state)
        if self._noise:
            factors = (1 + self._noise * uniform(self._seed, state.tick, 18)).tolist()
            most = self._range
            sonar = [min(distance * factor, most) for distance, factor in zip(sonar, factors, strict=False)]
            left, right = min(left * factors[16], 1.0), min(right * factors[17], 1.0)
        return Readings(
            run=state.run, tick=state.tick, episode=state.episode, epoch=state.epoch, sonar=sonar, light=(left, right),
            front=state.front, rear=state.rear, left=state.left, right=state.right, author=state.author,
            driver=state.driver,
        )  # fmt: skip

    def follow(self, moment: Moment) -> None:
        """Lead stateful models through a tick that another suite has answered."""
        for model in self._models:
            model(moment)

    def begun_anew(self, tick: int) -> None:
        """Tell stateful models that the ticks of the episode before this one are unknown."""
        for model in self._models:
            model.begun_anew(tick)

    def first(self, readings: Readings) -> tuple[list[float], Sequence[float]]:
        """The ranges and lights of the robot."""
        return readings.sonar, readings.light
