"""Measures the arena's obstacles: their thickness, their extent, and the distance of points from them."""

import math
from collections.abc import Iterator

import numpy as np

from phototaxis.geometry.arena import Arena, Disc, Point, Polygon, Wall

Solid = Wall | Polygon | Disc


def solids(arena: Arena) -> Iterator[tuple[str, Solid]]:
    """Every obstacle in the room, with its key, such as `walls[0]`."""
    for kind in ("walls", "polygons", "discs"):
        for index, solid in enumerate(getattr(arena, kind)):
            yield f"{kind}[{index}]", solid


def thickness(solid: Solid) -> float:
    """The smallest distance between two parallel lines that enclose the obstacle, m."""
    if isinstance(solid, Wall):
        return solid.thickness
    if isinstance(solid, Disc):
        return 2 * solid.radius
    return min(
        max(abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) for x, y in solid.corners)
        / (math.hypot(bx - ax, by - ay) or 1)
        for (ax, ay), (bx, by) in _sides(solid)
    )


def extent(solid: Solid) -> tuple[float, float, float, float]:
    """The bounding box: least x, least y, greatest x, greatest y, m."""
    if isinstance(solid, Wall):
        points, beyond = [solid.start, solid.end], solid.thickness / 2
    elif isinstance(solid, Disc):
        points, beyond = [solid.centre], solid.radius
    else:
        points, beyond = solid.corners, 0.0
    xs, ys = zip(*points, strict=True)
    return min(xs) - beyond, min(ys) - beyond, max(xs) + beyond, max(ys) + beyond


def distance(solid: Solid, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """How far points are from an obstacle, m; inside it, minus the depth. `x` and `y` broadcast."""
    if isinstance(solid, Wall):
        return _from_line(x, y, solid.start, solid.end) - solid.thickness / 2
    if isinstance(solid, Disc):
        return np.hypot(x - solid.centre[0], y - solid.centre[1]) - solid.radius
    turns = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for (ax, ay), (bx, by) in _sides(solid)]
    inside: np.ndarray = np.logical_and.reduce([turn > 0 for turn in turns]) | np.logical_and.reduce(
        [turn < 0 for turn in turns]
    )
    away: np.ndarray = np.minimum.reduce([_from_line(x, y, *side) for side in _sides(solid)])
    return np.where(inside, -away, away)


def _sides(polygon: Polygon) -> list[tuple[Point, Point]]:
    return list(zip(polygon.corners, polygon.corners[1:] + polygon.corners[:1], strict=True))


def _from_line(x: np.ndarray, y: np.ndarray, start: Point, end: Point) -> np.ndarray:
    """The distance of points from a line segment, m."""
    (ax, ay), (bx, by) = start, end
    dx, dy = bx - ax, by - ay
    along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    return np.hypot(x - ax - along * dx, y - ay - along * dy)
