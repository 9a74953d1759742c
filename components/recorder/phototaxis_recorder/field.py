"""The light intensity on a grid over the arena, with the shadows of walls and obstacles, as a background picture."""

import numpy as np
from phototaxis.geometry.arena import Arena

CELLS_A_SIDE = 120
"""Cells along the longer side of the room."""
DISC_CORNERS = 24
"""Corners of the polygon that stands for a disc."""
MAX_CELLS_TIMES_EDGES = 20_000_000
"""Cells × edges above which the picture has no shadows, because they would take more than a second."""


def light_field(arena: Arena) -> np.ndarray:
    """Return the light intensity, 0..1, at the middle of each cell, shape (rows, columns); row 0 is at y = 0.

    It is what a light sensor without noise reads when the robot's body hides nothing (inverse square or linear law).
    """
    width, height = arena.size
    cell = max(width, height) / CELLS_A_SIDE
    columns, rows = max(round(width / cell), 1), max(round(height / cell), 1)
    x, y = (np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * height / rows
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    edges = _edges(arena)
    total = np.zeros(len(places))
    for light in arena.lights:
        source = np.array(light.position)
        distance = np.linalg.norm(places - source, axis=1)
        if arena.sensing.light_law == "linear":
            share = np.maximum(1 - distance / arena.sensing.light_range, 0)
        else:
            share = 1 / np.maximum(distance, 1) ** 2
        if len(edges) * len(places) <= MAX_CELLS_TIMES_EDGES:
            share *= _sees(source, places, edges)
        total += light.brightness * share
    return np.minimum(total, 1).reshape(rows, columns)


def _edges(arena: Arena) -> np.ndarray:
    """Return everything opaque as line segments, shape (edges, 2, 2)."""
    found = [(wall.start, wall.end) for wall in arena.walls]
    for polygon in arena.polygons:
        found += zip(polygon.corners, [*polygon.corners[1:], polygon.corners[0]], strict=True)
    angle = np.arange(DISC_CORNERS) * 2 * np.pi / DISC_CORNERS
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for disc in arena.discs:
        corners = (np.array(disc.centre) + disc.radius * ring).tolist()
        found += zip(corners, [*corners[1:], corners[0]], strict=True)
    return np.array(found, dtype=float).reshape(-1, 2, 2)


def _sees(source: np.ndarray, places: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """For each place, return whether no edge crosses the line from the source to it; shape (places,)."""
    clear = np.ones(len(places), dtype=bool)
    ray = places - source
    for start, end in edges:
        side, off = end - start, start - source
        cross = ray[:, 0] * side[1] - ray[:, 1] * side[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            along_ray = (off[0] * side[1] - off[1] * side[0]) / cross
            along_edge = (off[0] * ray[:, 1] - off[1] * ray[:, 0]) / cross
        clear &= ~((along_ray > 0.02) & (along_ray < 0.98) & (along_edge >= 0) & (along_edge <= 1))
    return clear
