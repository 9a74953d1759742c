"""The sensor suite: everything the robot senses at one tick."""

from phototaxis.messages import Readings, State, World

from phototaxis_sensors.light import LightModel
from phototaxis_sensors.noise import uniform
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.sonar import SonarModel


class SensorSuite:
    """Readings as a pure function of (world, state): the same state gives the same readings, whenever asked."""

    def __init__(self, world: World):
        arena = world.arena
        scene = Scene(arena)
        self._seed, self._noise, self._range = world.seed, arena.sensing.noise, arena.robot.sonar_range
        self._sonar = SonarModel(arena, scene)
        self._light = LightModel(arena, scene)

    def __call__(self, state: State) -> Readings:
        """Answer one tick."""
        pose = state.x, state.y, state.heading
        sonar = self._sonar(*pose)
        left, right = self._light(*pose)
        if self._noise:
            factors = (1 + self._noise * uniform(self._seed, state.tick, 18)).tolist()
            most = self._range
            sonar = [min(distance * factor, most) for distance, factor in zip(sonar, factors, strict=False)]
            left, right = min(left * factors[16], 1.0), min(right * factors[17], 1.0)
        return Readings(
            state.run, state.tick, state.episode, state.epoch, sonar, (left, right),
            state.front, state.rear, state.left, state.right, state.author, state.driver,
        )  # fmt: skip
