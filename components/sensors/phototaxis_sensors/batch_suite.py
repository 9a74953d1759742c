"""The built-in sensors for many robots at once: the laws of `sonar` and `light`, in NumPy."""

import numpy as np
from phototaxis.geometry.arena import Light
from phototaxis.geometry.sight import LightSensors, Obstacles
from phototaxis.wire.messages import World

from phototaxis_sensors.noise import uniform
from phototaxis_sensors.sonar import RAY_SETBACK_M


class BatchSuite:
    """Readings of N robots as a pure function of (world, tick, poses)."""

    def __init__(self, world: World):
        arena = self._arena = world.arena
        self._seed, self._walls = world.seed, Obstacles(arena)
        self._lights = LightSensors(arena, self._walls)
        robot = arena.robot
        self._mounts = np.array([sonar.position for sonar in robot.sonars])
        angles = np.array([sonar.angle for sonar in robot.sonars])
        self._aim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._mounts = self._mounts - RAY_SETBACK_M * self._aim

    def __call__(self, tick: int, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sonars (16, N) in m and lights (2, N) in 0..1 at poses (N, 3)."""
        arena = self._arena
        sonar, light = self._sonar(poses), self._light(poses)
        if arena.sensing.noise:
            shaken = 1 + arena.sensing.noise * uniform(self._seed, tick, 18 * len(poses)).reshape(-1, 18).T
            sonar = np.minimum(sonar * shaken[:16], arena.robot.sonar_range)
            light = np.minimum(light * shaken[16:], 1.0)
        return sonar, light

    def _sonar(self, poses: np.ndarray) -> np.ndarray:
        reach = self._arena.robot.sonar_range + RAY_SETBACK_M
        x, y, heading = poses.T
        cos, sin = np.cos(heading), np.sin(heading)
        (mx, my), (ax, ay) = self._mounts.T[:, :, None], self._aim.T[:, :, None]
        start = x + cos * mx - sin * my, y + sin * mx + cos * my
        ray = reach * (cos * ax - sin * ay), reach * (sin * ax + cos * ay)
        return np.maximum(reach * self._walls.hit(start, ray) - RAY_SETBACK_M, 0.0)

    def _light(self, poses: np.ndarray) -> np.ndarray:
        return self._lights(poses)

    def sight(self, light: Light, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """As `LightSensors.sight` has it."""
        return self._lights.sight(light, poses)
