"""The built-in sonar model: 16 single rays from the robot's rim."""

import math

import numpy as np
from phototaxis.geometry.arena import Arena

from phototaxis_sensors.model import BuiltIn, Moment
from phototaxis_sensors.scene import Scene

RAY_SETBACK_M = 0.1
"""A ray starts this far inside the body, m, so that a rim pressed into a wall reads 0 and not what is behind it."""


class SonarModel(BuiltIn):
    """Ranges in metres, at most the sonar range, without noise."""

    def __init__(self, arena: Arena, scene: Scene):
        robot = arena.robot
        self._scene, self._range = scene, robot.sonar_range
        self._reach = robot.sonar_range + RAY_SETBACK_M
        mounts = np.array([sonar.position for sonar in robot.sonars])
        angles = np.array([sonar.angle for sonar in robot.sonars])
        aim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        starts = mounts - RAY_SETBACK_M * aim
        self._points = np.concatenate([starts, starts + self._reach * aim])  # (32, 2): starts, then ends

    def __call__(self, moment: Moment) -> list[float]:
        """The 16 ranges."""
        cos, sin = math.cos(moment.heading), math.sin(moment.heading)
        turned = self._points @ np.array([[cos, sin], [-sin, cos]])
        turned += (moment.x, moment.y)
        points = turned.tolist()
        hit, reach = self._scene.hit, self._reach
        found = [reach * hit(start, end) - RAY_SETBACK_M for start, end in zip(points[:16], points[16:], strict=True)]
        return [distance if distance > 0 else 0.0 for distance in found]
