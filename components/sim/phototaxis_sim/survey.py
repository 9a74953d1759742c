"""Finds suspicious properties of an arena before it is used, by placing the robot at random."""

from collections.abc import Iterator

import numpy as np
from phototaxis.geometry.arena import Arena
from phototaxis.geometry.sight import LightSensors, Obstacles
from phototaxis.geometry.solids import extent, solids
from phototaxis.runtime.errors import UserError
from phototaxis.task import GOAL_LIGHT

from phototaxis_sim.physics import Physics, Pose
from phototaxis_sim.reachability import ReachabilityGrid

_PLACEMENTS = 300
_MAX_SOLIDS = 5_000
_NEARLY_ALWAYS, _OFTEN, _SELDOM = 0.95, 0.5, 0.01


def survey(arena: Arena) -> list[str]:
    """Return what may be wrong with an arena, one line each.

    Raises
    ------
    UserError
        when the robot can be placed nowhere, or hardly anywhere but where the light is reached already.
    """
    starts, share = Physics(arena).sample(np.random.default_rng(0), _PLACEMENTS)
    lit = _lit(arena, np.array(starts))
    if lit.mean() > _NEARLY_ALWAYS:
        raise UserError(
            f"placement.light_distance: the light is reached already at {lit.mean():.0%} of {len(starts)} random "
            f"placements, so that hardly an episode has a step; begin further from the lights, or dim them "
            f"(lights[0].brightness)"
        )
    found = [*_outside(arena)]
    if share < _SELDOM:
        found.append(f"placement: only at {share:.2%} of the room's places is the robot free to begin")
    if lit.mean() > _OFTEN:
        found.append(f"lights: at {lit.mean():.0%} of the placements the light is reached before the first step")
    return [*found, *_cut_off(arena, [start for start, there in zip(starts, lit.tolist(), strict=True) if not there])]


def _lit(arena: Arena, poses: np.ndarray) -> np.ndarray:
    """Whether the light counts as reached at poses (N, 3), whatever the noise is; (N,) bool."""
    light, noise = LightSensors(arena, Obstacles(arena))(poses).max(axis=0), arena.sensing.noise
    return (light > GOAL_LIGHT) & (light * (1 - noise) >= GOAL_LIGHT)  # the least noise of all has probability 0


def _outside(arena: Arena) -> Iterator[str]:
    """Obstacles outside the room, and light sensors outside the robot's body."""
    width, height = arena.size
    for key, solid in solids(arena):
        x0, y0, x1, y1 = extent(solid)
        if x1 <= 0 or y1 <= 0 or x0 >= width or y0 >= height:
            yield f"{key}: is outside the room"
    for index, (x, y) in enumerate(arena.robot.light_sensors):
        if abs(x) > arena.robot.length / 2 + 1e-9 or abs(y) > arena.robot.width / 2 + 1e-9:
            yield f"robot.light_sensors[{index}]: is outside the robot's body, so that it passes through walls"


def _cut_off(arena: Arena, starts: list[Pose]) -> list[str]:
    """Warn if there are placements from which no light seems reachable."""
    if len(list(solids(arena))) > _MAX_SOLIDS:
        return []
    grid = ReachabilityGrid(arena)
    if grid.coarse:
        return []
    lost = sum(not grid.hopeful(start.x, start.y) for start in starts)
    if not lost:
        return []
    whence = "any placement" if lost == len(starts) else f"{lost / len(starts):.0%} of the placements"
    return [f"lights: from {whence} there seems to be no way to where a light sensor would read more than {GOAL_LIGHT}"]
