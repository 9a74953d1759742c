"""A look at an arena before it is used: what can be suspected by placing the robot and looking around.

The robot is placed at random as an episode would place it. Where it can get from there is found on a grid, for a
disc as wide as the robot's narrower side, so that a way that is found may still be too narrow for the robot; that
it finds none is therefore worth a warning.
"""

import math
from collections.abc import Iterator

import numpy as np
from phototaxis.arena import Arena
from phototaxis.errors import UserError
from phototaxis.sight import LightSensors, Obstacles, falloff
from phototaxis.task import REACHED

from phototaxis_sim.physics import Physics, Pose

PLACEMENTS = 300
_HEADINGS = 12
_LOOKS = 300
"""Cells in which the light is looked for, out of those that it could brighten."""
_MOST_CELLS = 160_000
_MOST_OBSTACLES = 5_000
_OFTEN = 0.5
_SELDOM = 0.01


def survey(arena: Arena) -> list[str]:
    """What may be wrong with an arena, a line each.

    Raises
    ------
    UserError
        when the robot can be placed nowhere, or only where the light is reached already.
    """
    physics = Physics(arena)
    found = [*_outside(arena)]
    starts, share = physics.sample(np.random.default_rng(0), PLACEMENTS)
    if share < _SELDOM:
        found.append(f"placement: only {share:.2%} of the room's places are free for the robot to start from")
    lit = _lit(arena, np.array(starts))
    if lit.all():
        raise UserError(
            f"placement.light_distance: the light is reached already at each of {len(starts)} random placements, "
            f"so that no episode has a step; begin further from the lights, or dim them (lights[0].brightness)"
        )
    if lit.mean() > _OFTEN:
        found.append(f"lights: at {lit.mean():.0%} of the placements the light is reached before the first step")
    return [*found, *_cut_off(arena, [start for start, there in zip(starts, lit.tolist(), strict=True) if not there])]


def _lit(arena: Arena, poses: np.ndarray) -> np.ndarray:
    """Whether the light counts as reached at poses (N, 3), whatever the noise is; (N,) bool."""
    light, noise = LightSensors(arena, Obstacles(arena))(poses).max(axis=0), arena.sensing.noise
    return (light > REACHED) & (light * (1 - noise) >= REACHED)  # noise below all its values has probability 0


def _outside(arena: Arena) -> Iterator[str]:
    """Obstacles outside the room, and sensors outside the robot's body."""
    width, height = arena.size
    for kind in ("walls", "polygons", "discs"):
        for index, (x0, y0, x1, y1) in enumerate(_boxes(arena, kind)):
            if x1 <= 0 or y1 <= 0 or x0 >= width or y0 >= height:
                yield f"{kind}[{index}]: is outside the room"
    half = arena.robot.length / 2 + 1e-9, arena.robot.width / 2 + 1e-9
    for index, place in enumerate(arena.robot.light_sensors):
        if abs(place[0]) > half[0] or abs(place[1]) > half[1]:
            yield f"robot.light_sensors[{index}]: is outside the robot's body, so that it passes through walls"


def _boxes(arena: Arena, kind: str) -> Iterator[tuple[float, float, float, float]]:
    """The extent of each obstacle of a kind: least x, least y, greatest x, greatest y."""
    for one in getattr(arena, kind):
        radius = getattr(one, "thickness", 0) / 2 or getattr(one, "radius", 0)
        points = one.corners if kind == "polygons" else [one.centre] if kind == "discs" else [one.start, one.end]
        xs, ys = zip(*points, strict=True)
        yield min(xs) - radius, min(ys) - radius, max(xs) + radius, max(ys) + radius


def _cut_off(arena: Arena, starts: list[Pose]) -> list[str]:
    """Whether there are places from which the light seems to be out of reach."""
    if len(arena.walls) + len(arena.polygons) + len(arena.discs) > _MOST_OBSTACLES:
        return []
    grid = Grid(arena)
    if grid.coarse:
        return []
    lost = sum(not grid.hopeful(start) for start in starts)
    if not lost:
        return []
    whom = "any placement" if lost == len(starts) else f"{lost / len(starts):.0%} of the placements"
    return [f"lights: from {whom} there seems to be no way to where a light sensor would read more than {REACHED}"]


class Grid:
    """Cells of the room, those in which the robot's middle could be, and which of them hang together.

    Attributes
    ----------
    coarse : the room is too large for cells that would show a gap as narrow as the robot.
    """

    def __init__(self, arena: Arena):
        self._arena = arena
        width, height = arena.size
        radius = min(arena.robot.length, arena.robot.width) / 2
        self._side = side = max(radius / 4, math.sqrt(width * height / _MOST_CELLS))
        self.coarse = side > radius / 2
        self._shape = math.ceil(width / side), math.ceil(height / side)
        self._free = np.ones(self._shape, bool)
        self._region = np.full(self._shape, -1)
        self._bright: list[bool] = []
        if not self.coarse:
            self._mark(0.95 * radius - 0.71 * side)

    def hopeful(self, start: Pose) -> bool:
        """Whether the light can be reached in a cell that hangs together with this one."""
        cell = tuple(min(int(at / self._side), most - 1) for at, most in zip(start[:2], self._shape, strict=True))
        if self._region[cell] < 0:
            self._fill(cell)
            self._bright.append(self._is_bright(len(self._bright)))
        return self._bright[self._region[cell]]

    def _mark(self, margin: float) -> None:
        """Cells whose middle is nearer to an obstacle, or to the room's border, than `margin` are not free."""
        side, arena = self._side, self._arena
        rim = max(math.ceil(margin / side - 0.5), 0)
        self._free[:rim] = self._free[len(self._free) - rim :] = False
        self._free[:, :rim] = self._free[:, self._shape[1] - rim :] = False
        for kind in ("walls", "polygons", "discs"):
            for one, (x0, y0, x1, y1) in zip(getattr(arena, kind), _boxes(arena, kind), strict=True):
                columns = slice(max(int((x0 - margin) / side), 0), max(int((x1 + margin) / side) + 1, 0))
                rows = slice(max(int((y0 - margin) / side), 0), max(int((y1 + margin) / side) + 1, 0))
                x = (np.arange(self._shape[0])[columns, None] + 0.5) * side
                y = (np.arange(self._shape[1])[None, rows] + 0.5) * side
                self._free[columns, rows] &= _distance(one, kind, x, y) > margin

    def _fill(self, start: tuple[int, ...]) -> None:
        """Give all cells that hang together with one the number of a new region."""
        width, height = self._shape
        region, free, number = self._region.ravel(), self._free.ravel(), len(self._bright)
        todo = [start[0] * height + start[1]]
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
        """Whether a light sensor could read more than `REACHED` in a region."""
        arena = self._arena
        places = (np.argwhere(self._region == number) + 0.5) * self._side
        ahead = max(math.hypot(*place) for place in arena.robot.light_sensors)
        most = np.zeros(len(places))
        for light in arena.lights:
            nearest = np.maximum(np.hypot(*(places - light.position).T) - ahead - self._side, 0.0)
            most += light.brightness * falloff(arena.sensing, nearest)
        enough = REACHED / (1 + arena.sensing.noise)
        places = places[most > enough]
        if len(places) > _LOOKS:
            places = places[np.linspace(0, len(places) - 1, _LOOKS).astype(int)]
        headings = np.linspace(-math.pi, math.pi, _HEADINGS, endpoint=False)
        poses = np.column_stack([np.repeat(places, _HEADINGS, axis=0), np.tile(headings, len(places))])
        obstacles = Obstacles(arena)
        x, y, heading = poses.T
        mounts = np.array(arena.robot.light_sensors).T[:, :, None]
        cos, sin = np.cos(heading), np.sin(heading)
        ray = cos * mounts[0] - sin * mounts[1], sin * mounts[0] + cos * mounts[1]
        through = obstacles.hit((np.broadcast_to(x, ray[0].shape), np.broadcast_to(y, ray[0].shape)), ray) < 1
        return bool(((LightSensors(arena, obstacles)(poses) > enough) & ~through).any())


def _distance(obstacle: object, kind: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """How far points (x, 1), (1, y) are from an obstacle, m; 0 or less inside."""
    if kind == "discs":
        return np.hypot(x - obstacle.centre[0], y - obstacle.centre[1]) - obstacle.radius
    if kind == "walls":
        return _from_line(x, y, obstacle.start, obstacle.end) - obstacle.thickness / 2
    corners = obstacle.corners
    sides = list(zip(corners, corners[1:] + corners[:1], strict=True))
    away = np.minimum.reduce([_from_line(x, y, *side) for side in sides])
    turns = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for (ax, ay), (bx, by) in sides]
    inside = np.logical_and.reduce([turn > 0 for turn in turns]) | np.logical_and.reduce([turn < 0 for turn in turns])
    return np.where(inside, 0.0, away)


def _from_line(x: np.ndarray, y: np.ndarray, start: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    (ax, ay), (bx, by) = start, end
    dx, dy = bx - ax, by - ay
    along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    return np.hypot(x - ax - along * dx, y - ay - along * dy)
