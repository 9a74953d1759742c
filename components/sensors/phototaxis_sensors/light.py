"""The built-in light model: distance falloff, occlusion by walls and by the robot's own body."""

import math
from typing import NamedTuple

from phototaxis.geometry.arena import Arena, Light
from phototaxis.geometry.sight import LAMP_CLEARANCE_M

from phototaxis_sensors.model import BuiltIn, Moment
from phototaxis_sensors.scene import Scene


class Sight(NamedTuple):
    """One lamp as one light sensor sees it."""

    ahead: float
    """The lamp's place relative to the sensor in the robot's frame, m: ahead and to the left."""
    aside: float
    brightness: float
    visible: bool
    """Whether neither a wall nor the robot's own body is in between."""

    @property
    def distance(self) -> float:
        """Distance from the sensor to the lamp, m."""
        return math.hypot(self.ahead, self.aside)

    @property
    def bearing(self) -> float:
        """Direction of the lamp from straight ahead, rad, positive to the left."""
        return math.atan2(self.aside, self.ahead)


class Sights:
    """What the light sensors see: each lamp at its place, or hidden."""

    def __init__(self, arena: Arena, scene: Scene):
        self._scene, self._lights, self._body_shadow = scene, arena.lights, arena.sensing.body_shadow
        self._sensors = arena.robot.light_sensors
        self._half = arena.robot.length / 2, arena.robot.width / 2

    def __call__(self, moment: Moment) -> list[list[Sight]]:
        """For the front-left and the front-right sensor: a sight of each lamp."""
        x, y = moment.x, moment.y
        cos, sin = math.cos(moment.heading), math.sin(moment.heading)
        return [[self._one(light, sensor, x, y, cos, sin) for light in self._lights] for sensor in self._sensors]

    def _one(self, light: Light, sensor: tuple[float, float], x: float, y: float, cos: float, sin: float) -> Sight:
        dx, dy = light.position[0] - x, light.position[1] - y
        lx, ly = cos * dx + sin * dy, cos * dy - sin * dx  # the light in the robot's frame
        sx, sy = sensor
        visible = not (self._body_shadow and self._through_body(lx, ly, sx, sy))
        distance = math.hypot(lx - sx, ly - sy)
        if visible and distance > LAMP_CLEARANCE_M:
            eye = x + cos * sx - sin * sy, y + sin * sx + cos * sy
            share = 1 - LAMP_CLEARANCE_M / distance
            lamp = (
                eye[0] + share * (light.position[0] - eye[0]),
                eye[1] + share * (light.position[1] - eye[1]),
            )
            visible = not self._scene.blocked(eye, lamp)
        return Sight(lx - sx, ly - sy, light.brightness, visible)

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


class LightModel(BuiltIn):
    """Readings in 0..1, without noise: the visible lights are summed and clipped."""

    def __init__(self, arena: Arena, scene: Scene):
        self._sights, self._sensing = Sights(arena, scene), arena.sensing

    def __call__(self, moment: Moment) -> tuple[float, float]:
        """The front-left and the front-right reading."""
        left, right = (min(sum(map(self._reading, sights)), 1.0) for sights in self._sights(moment))
        return left, right

    def _reading(self, sight: Sight) -> float:
        """The reading that one lamp gives one sensor."""
        return sight.brightness * self._falloff(sight.distance) if sight.visible else 0.0

    def _falloff(self, distance: float) -> float:
        if self._sensing.light_law == "linear":
            return max(1 - distance / self._sensing.light_range, 0.0)
        return 1.0 if distance <= 1 else 1 / (distance * distance)
