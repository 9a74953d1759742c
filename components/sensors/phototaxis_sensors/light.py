"""The built-in light model: distance falloff, occlusion by walls and by the robot's own body."""

import math

from phototaxis.arena import Arena, Light

from phototaxis_sensors.scene import Scene

SHORT = 0.1
"""The line of sight stops this far from the light, m, so that a lamp may stand in a socket."""


class LightModel:
    """Readings in 0..1, without noise: the visible lights are summed and clipped."""

    def __init__(self, arena: Arena, scene: Scene):
        self._scene, self._lights, self._sensing = scene, arena.lights, arena.sensing
        self._sensors = arena.robot.light_sensors
        self._half = arena.robot.length / 2, arena.robot.width / 2

    def __call__(self, x: float, y: float, heading: float) -> tuple[float, float]:
        """The front-left and the front-right reading at a pose."""
        cos, sin = math.cos(heading), math.sin(heading)
        left, right = (
            min(sum(self._one(light, sensor, x, y, cos, sin) for light in self._lights), 1.0)
            for sensor in self._sensors
        )
        return left, right

    def _one(self, light: Light, sensor: tuple[float, float], x: float, y: float, cos: float, sin: float) -> float:
        """What one light gives to one sensor."""
        dx, dy = light.position[0] - x, light.position[1] - y
        lx, ly = cos * dx + sin * dy, cos * dy - sin * dx  # the light in the robot's frame
        sx, sy = sensor
        if self._sensing.body_shadow and self._through_body(lx, ly, sx, sy):
            return 0.0
        distance = math.hypot(lx - sx, ly - sy)
        if distance > SHORT:
            eye = x + cos * sx - sin * sy, y + sin * sx + cos * sy
            share = 1 - SHORT / distance
            lamp = (
                eye[0] + share * (light.position[0] - eye[0]),
                eye[1] + share * (light.position[1] - eye[1]),
            )
            if self._scene.blocked(eye, lamp):
                return 0.0
        return light.brightness * self._falloff(distance)

    def _falloff(self, distance: float) -> float:
        if self._sensing.light_law == "linear":
            return max(1 - distance / self._sensing.light_range, 0.0)
        return 1.0 if distance <= 1 else 1 / (distance * distance)

    def _through_body(self, lx: float, ly: float, sx: float, sy: float) -> bool:
        """Whether the line from light to sensor crosses the inside of the body's rectangle (slab method)."""
        enter, leave = 0.0, 1.0
        for start, end, half in ((lx, sx, self._half[0]), (ly, sy, self._half[1])):
            step = end - start
            if step == 0:
                if abs(start) >= half:
                    return False
                continue
            a, b = (-half - start) / step, (half - start) / step
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        return leave - enter > 1e-9
