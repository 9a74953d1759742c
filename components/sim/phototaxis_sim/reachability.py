"""Divides the room into a grid, and tells from which cells the robot could reach a light.

The robot counts as a disc as wide as its narrower side, so a path on the grid may still be too narrow for it;
but if there is no path, the robot cannot get there.
"""

import math

import numpy as np
from phototaxis.geometry.arena import Arena
from phototaxis.geometry.sight import LightSensors, Obstacles, falloff
from phototaxis.geometry.solids import distance, extent, solids
from phototaxis.task import GOAL_LIGHT

_HEADINGS = 12
_MAX_LOOKS = 300
"""Cells of a region in which the light is looked for, out of those that it could brighten."""
_MAX_CELLS = 160_000


class ReachabilityGrid:
    """Cells of the room, those in which the robot's middle could be, and which of them hang together.

    Attributes
    ----------
    coarse : the room is too large for cells that would show a gap as narrow as the robot; nothing can be said.
    """

    def __init__(self, arena: Arena):
        self._arena = arena
        width, height = arena.size
        radius = min(arena.robot.length, arena.robot.width) / 2
        self._side = side = max(radius / 4, math.sqrt(width * height / _MAX_CELLS))
        self.coarse = side > radius / 2
        if self.coarse:
            return
        self._shape = math.ceil(width / side), math.ceil(height / side)
        self._x, self._y = ((np.arange(count) + 0.5) * side for count in self._shape)
        self._free = self._mark(0.95 * radius - 0.71 * side)
        self._region = np.full(self._shape, -1)
        self._bright: list[bool] = []

    def hopeful(self, x: float, y: float) -> bool:
        """Whether a light can be reached in a cell that hangs together with the one at a place."""
        cell = min(int(x / self._side), self._shape[0] - 1), min(int(y / self._side), self._shape[1] - 1)
        if self._region[cell] < 0:
            self._fill(*cell)
            self._bright.append(self._is_bright(len(self._bright)))
        return self._bright[self._region[cell]]

    def _mark(self, margin: float) -> np.ndarray:
        """Which cells have their middle further than `margin` from every obstacle and from the room's border."""
        side, (width, height) = self._side, self._arena.size
        x, y = self._x[:, None], self._y[None]
        free = (np.minimum(x, width - x) > margin) & (np.minimum(y, height - y) > margin)
        for _, solid in solids(self._arena):
            x0, y0, x1, y1 = extent(solid)
            near = tuple(
                slice(max(int((low - margin) / side), 0), max(int((high + margin) / side) + 1, 0))
                for low, high in ((x0, x1), (y0, y1))
            )
            free[near] &= distance(solid, self._x[near[0], None], self._y[None, near[1]]) > margin
        return free

    def _fill(self, column: int, row: int) -> None:
        """Give all cells that hang together with one the number of a new region."""
        width, height = self._shape
        region, free, number = self._region.ravel(), self._free.ravel(), len(self._bright)
        todo = [column * height + row]
        region[todo[0]] = number
        while todo:
            cell = todo.pop()
            row = cell % height
            for other, there in (
                (cell - height, cell >= height),
                (cell + height, cell < (width - 1) * height),
                (cell - 1, row > 0),
                (cell + 1, row < height - 1),
            ):
                if there and free[other] and region[other] < 0:
                    region[other] = number
                    todo.append(other)

    def _is_bright(self, number: int) -> bool:
        """Whether a light sensor could read more than `GOAL_LIGHT` in a region, at some of its cells and headings."""
        arena = self._arena
        places = (np.argwhere(self._region == number) + 0.5) * self._side
        mounts = np.array(arena.robot.light_sensors).T[:, :, None]
        most, enough = np.zeros(len(places)), GOAL_LIGHT / (1 + arena.sensing.noise)
        for light in arena.lights:
            nearest = np.hypot(*(places - light.position).T) - np.hypot(*mounts).max() - self._side
            most += light.brightness * falloff(arena.sensing, np.maximum(nearest, 0.0))
        places = places[most > enough]
        if len(places) > _MAX_LOOKS:
            places = places[np.linspace(0, len(places) - 1, _MAX_LOOKS).astype(int)]
        headings = np.tile(np.linspace(-math.pi, math.pi, _HEADINGS, endpoint=False), len(places))
        poses = np.column_stack([np.repeat(places, _HEADINGS, axis=0), headings])
        obstacles, cos, sin = Obstacles(arena), np.cos(headings), np.sin(headings)
        arm = cos * mounts[0] - sin * mounts[1], sin * mounts[0] + cos * mounts[1]
        middle = np.broadcast_to(poses[:, :1].T, arm[0].shape), np.broadcast_to(poses[:, 1:2].T, arm[0].shape)
        here = obstacles.hit(middle, arm) == 1  # not a sensor that would be behind a wall
        return bool(((LightSensors(arena, obstacles)(poses) > enough) & here).any())
