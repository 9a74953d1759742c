"""How far a robot may move between two looks at its contacts, so that it passes through nothing.

Physics moves a body and then looks what it overlaps. A body that overlaps an obstacle by no more than `max_overlap`
keeps its middle on the side it came from, and none of its points, a light sensor among them, comes out behind a wall.
"""

import math

from phototaxis.geometry.arena import Arena
from phototaxis.geometry.solids import solids, thickness

_SHARE = 0.6
"""Of half the body's narrower side: what it may overlap an obstacle by."""


def thinnest(arena: Arena) -> tuple[float, str]:
    """The thickness of the thinnest obstacle, m, and its key; infinite without any."""
    return min(((thickness(solid), key) for key, solid in solids(arena)), default=(math.inf, ""))


def max_overlap(arena: Arena) -> float:
    """How deep the robot may overlap an obstacle, m."""
    return min(_SHARE * min(arena.robot.length, arena.robot.width) / 2, thinnest(arena)[0])


def max_move(arena: Arena) -> float:
    """How far the solver may move any point of the robot at once, m: less than what it never overlaps is wide."""
    return 2 * (1 - _SHARE) * min(arena.robot.length, arena.robot.width) / 2


def max_speed(arena: Arena) -> float:
    """The highest speed of any point of the robot, m/s: all of it straight on, or a corner while it turns."""
    robot = arena.robot
    return max(robot.speed, robot.turn * math.hypot(robot.length, robot.width) / 2)


def substeps(arena: Arena) -> int:
    """Into how many substeps a physics step is divided, so that no point moves further than `max_overlap` in one."""
    return max(math.ceil(max_speed(arena) * arena.motion.physics_step / max_overlap(arena) - 1e-9), 1)
