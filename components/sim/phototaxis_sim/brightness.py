"""Whether the lights of an arena are bright enough to be reached."""

import numpy as np
from phototaxis.geometry.arena import Arena
from phototaxis.geometry.sight import falloff
from phototaxis.task import GOAL_LIGHT

_MAX_CELLS = 4096
"""Cells of the search for a bright place, at a time."""


def too_dim(arena: Arena) -> str | None:
    """Return an error line if no light can ever count as reached, else None."""
    noise = arena.sensing.noise
    brightest = (1 + noise) * _brightest(arena, GOAL_LIGHT / (1 + noise))
    if brightest > GOAL_LIGHT:
        return None
    index = max(range(len(arena.lights)), key=lambda index: arena.lights[index].brightness)
    return (
        f"lights[{index}].brightness: no sensor can ever read more than {brightest:.3g}, "
        f"and the light counts as reached above {GOAL_LIGHT}"
    )


def _brightest(arena: Arena, enough: float) -> float:
    """An upper bound of the sum of all lights anywhere, as tight as it needs to be compared with `enough`.

    Cells that are too dark even if each light stood at its nearest point are dropped, the others quartered.
    """
    places = np.array([light.position for light in arena.lights])
    brightness = np.array([light.brightness for light in arena.lights])
    low, high = places.min(axis=0), places.max(axis=0)
    middle, half = ((low + high) / 2)[None], (high - low) / 2
    while True:
        off = np.abs(middle[:, None] - places)
        nearest, centre = np.maximum(off - half, 0.0), np.hypot(off[:, :, 0], off[:, :, 1])
        bound = falloff(arena.sensing, np.hypot(nearest[:, :, 0], nearest[:, :, 1])) @ brightness
        here = falloff(arena.sensing, centre) @ brightness
        hopeful = bound > enough
        if not hopeful.any() or (here > enough).any() or 4 * hopeful.sum() > _MAX_CELLS or half.max() < 1e-3:
            return float(bound.max())
        half = half / 2
        corners = np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)]) * half
        middle = (middle[hopeful][:, None] + corners).reshape(-1, 2)
