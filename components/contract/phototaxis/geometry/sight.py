"""Computes what the light sensors of many robots see, in NumPy, with occlusion by obstacles and by the own body.

The batch sensors use it, and the check whether the robot can reach the light in an arena.
"""

import math

import numpy as np

from phototaxis.geometry.arena import Arena, Light, Sensing

LAMP_CLEARANCE_M = 0.1
"""The line of sight stops this far from the light, m, so that a light may touch or enter an obstacle a little."""


def falloff(law: Sensing, distance: np.ndarray) -> np.ndarray:
    """The reading that a light of brightness 1 gives at a distance in m."""
    if law.light_law == "linear":
        return np.maximum(1 - distance / law.light_range, 0.0)
    return 1 / np.maximum(distance, 1.0) ** 2


class LightSensors:
    """The two light sensors of each robot in an arena, without noise."""

    def __init__(self, arena: Arena, obstacles: "Obstacles"):
        self._arena, self._walls = arena, obstacles

    def __call__(self, poses: np.ndarray) -> np.ndarray:
        """Readings (2, N) in 0..1 at poses (N, 3)."""
        total = np.zeros((2, len(poses)))
        for light in self._arena.lights:
            _, _, distance, visible = self.sight(light, poses)
            total += np.where(visible, light.brightness * falloff(self._arena.sensing, distance), 0.0)
        return np.minimum(total, 1.0)

    def sight(self, light: Light, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """How each robot's two sensors see one light: four arrays (2, N).

        They are the light's place relative to the sensor (east and north, m), its distance (m), and whether it is
        visible: neither an obstacle nor the robot's own body is in between.
        """
        x, y, heading = poses.T
        cos, sin = np.cos(heading), np.sin(heading)
        mounts = np.array(self._arena.robot.light_sensors).T[:, :, None]
        eye = x + cos * mounts[0] - sin * mounts[1], y + sin * mounts[0] + cos * mounts[1]
        to_light = light.position[0] - eye[0], light.position[1] - eye[1]
        distance = np.hypot(*to_light)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(distance > LAMP_CLEARANCE_M, 1 - LAMP_CLEARANCE_M / distance, 0.0)
        dark = self._walls.hit(eye, (share * to_light[0], share * to_light[1])) < 1
        if self._arena.sensing.body_shadow:
            dark |= self._through_body(light, poses)
        return *to_light, distance, ~dark

    def _through_body(self, light: Light, poses: np.ndarray) -> np.ndarray:
        """Whether the line from light to sensor crosses the inside of the body's rectangle (slab method)."""
        x, y, heading = poses.T
        cos, sin = np.cos(heading), np.sin(heading)
        dx, dy = light.position[0] - x, light.position[1] - y
        robot = self._arena.robot
        mounts = np.array(robot.light_sensors)
        enter, leave = np.zeros((2, len(poses))), np.ones((2, len(poses)))
        for start, end, half in (
            (cos * dx + sin * dy, mounts[:, :1], robot.length / 2),
            (cos * dy - sin * dx, mounts[:, 1:], robot.width / 2),
        ):
            low, high = slab(np.broadcast_to(start, enter.shape), end - start, -half, half)
            enter, leave = np.maximum(enter, low), np.minimum(leave, high)
        return leave - enter > 1e-9


def slab(start: np.ndarray, step: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a ray along one axis enters and leaves the open interval low..high, in units of `step`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - start) / step, (high - start) / step
    inside = (low < start) & (start < high)
    still = step == 0
    enter = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(a, b))
    leave = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(a, b))
    return enter, leave


class Obstacles:
    """Everything that a ray can hit, as convex outlines and discs; a ray that starts inside one hits it at 0."""

    def __init__(self, arena: Arena):
        self._size = arena.size
        outlines = [np.array(polygon.corners) for polygon in arena.polygons]
        self._discs = [(*disc.centre, disc.radius) for disc in arena.discs]
        for wall in arena.walls:  # a rectangle with round ends
            start, end, half = np.array(wall.start), np.array(wall.end), wall.thickness / 2
            self._discs += [(*wall.start, half), (*wall.end, half)]
            if length := math.dist(wall.start, wall.end):
                aside = half / length * np.array([start[1] - end[1], end[0] - start[0]])
                outlines.append(np.array([start + aside, end + aside, end - aside, start - aside]))
        self._outlines = [half_planes(corners) for corners in outlines]

    def hit(self, start: tuple[np.ndarray, np.ndarray], ray: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Where each ray first hits an obstacle, from 0 (its start) to 1 (its end); 1 if it hits nothing."""
        (x, y), (dx, dy) = start, ray
        first = np.ones(x.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            for at, step, size in ((x, dx, self._size[0]), (y, dy, self._size[1])):
                wall = np.where(step == 0, 1.0, (np.where(step > 0, size, 0.0) - at) / step)
                first = np.fmin(first, np.where((at > 0) & (at < size), wall, 0.0))
            for planes in self._outlines:
                enter, leave = np.full(x.shape, -np.inf), np.full(x.shape, np.inf)
                for nx, ny, offset in planes:
                    away, closing = nx * x + ny * y - offset, -(nx * dx + ny * dy)
                    cut = away / closing
                    enter = np.where(closing > 0, np.maximum(enter, cut), enter)
                    leave = np.where(closing < 0, np.minimum(leave, cut), leave)
                    leave = np.where((closing == 0) & (away > 0), -np.inf, leave)
                first = np.where((enter <= leave) & (leave > 0), np.minimum(first, np.maximum(enter, 0.0)), first)
            for cx, cy, radius in self._discs:
                fx, fy = x - cx, y - cy
                a, b, c = dx * dx + dy * dy, fx * dx + fy * dy, fx * fx + fy * fy - radius * radius
                along = np.where(c < 0, 0.0, (-b - np.sqrt(b * b - a * c)) / a)
                first = np.where(along >= 0, np.minimum(first, along), first)
        return first


def half_planes(corners: np.ndarray) -> list[tuple[float, float, float]]:
    """A convex outline as (nx, ny, offset): inside is where nx·x + ny·y < offset for all."""
    following = np.roll(corners, -1, axis=0)
    along = following - corners
    area = np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0])
    normals = np.sign(area) * np.stack([along[:, 1], -along[:, 0]], axis=1)
    return [(nx, ny, nx * x + ny * y) for (nx, ny), (x, y) in zip(normals.tolist(), corners.tolist(), strict=True)]
