"""Limits how far a robot moves between two collision checks, so that it cannot pass through an obstacle.

The solver moves a body and then checks what it overlaps. While the overlap is at most `max_overlap`, the body's
middle stays on its side of a wall, and no point of the body, such as a light sensor, reaches the other side.
"""

import math

from phototaxis.geometry.arena import Arena
from phototaxis.geometry.solids import solids, thickness

_SHARE = 0.6
"""Largest overlap with an obstacle, as a share of half the body's narrower side."""


def thinnest(arena: Arena) -> tuple[float, str]:
    """The thickness of the thinnest obstacle, m, and its key; infinity and "" without obstacles."""
    return min(((thickness(solid), key) for key, solid in solids(arena)), default=(math.inf, ""))


def max_overlap(arena: Arena) -> float:
    """How deep the robot may overlap an obstacle, m."""
    return min(_SHARE * min(arena.robot.length, arena.robot.width) / 2, thinnest(arena)[0])


def max_move(arena: Arena) -> float:
    """Largest move of any point of the robot in one step, m: twice what `_SHARE` leaves of half its narrower side."""
    return 2 * (1 - _SHARE) * min(arena.robot.length, arena.robot.width) / 2


def max_speed(arena: Arena) -> float:
    """The highest speed of any point of the robot, m/s: of all points ahead, or of a corner in a turn on the spot."""
    robot = arena.robot
    return max(robot.speed, robot.turn * math.hypot(robot.length, robot.width) / 2)


def substeps(arena: Arena) -> int:
    """Number of substeps in a physics step, so that no point moves further than `max_overlap` in one."""
    return max(math.ceil(max_speed(arena) * arena.motion.physics_step / max_overlap(arena) - 1e-9), 1)
