"""How far a robot may move between two looks at its contacts, so that it passes through nothing.

Physics moves a body and then looks what it overlaps. A body that overlaps an obstacle by no more than `deepest`
keeps its middle on the side it came from, and none of its points, a light sensor among them, comes out behind a wall.
"""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from phototaxis.arena import Arena, Polygon

_SHARE = 0.6
"""Of half the body's narrower side: what it may overlap an obstacle by."""


def thinnest(arena: "Arena") -> tuple[float, str]:
    """The smallest extent of all obstacles, m, and the key of that obstacle; infinite without any."""
    sizes = [
        *((wall.thickness, f"walls[{index}].thickness") for index, wall in enumerate(arena.walls)),
        *((2 * disc.radius, f"discs[{index}].radius") for index, disc in enumerate(arena.discs)),
        *((narrowest(polygon), f"polygons[{index}].corners") for index, polygon in enumerate(arena.polygons)),
    ]
    return min(sizes, default=(math.inf, ""))


def narrowest(polygon: "Polygon") -> float:
    """The smallest distance of two parallel lines that have a convex polygon between them, m."""
    corners = polygon.corners
    return min(
        max(abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) for x, y in corners) / (math.hypot(bx - ax, by - ay) or 1)
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)
    )


def deepest(arena: "Arena") -> float:
    """How deep the robot may overlap an obstacle, m."""
    return min(_SHARE * min(arena.robot.length, arena.robot.width) / 2, thinnest(arena)[0])


def furthest(arena: "Arena") -> float:
    """How far the solver may move any point of the robot at once, m: less than what it never overlaps is wide."""
    return 2 * (1 - _SHARE) * min(arena.robot.length, arena.robot.width) / 2


def fastest(arena: "Arena") -> float:
    """The highest speed of any point of the robot, m/s: all of it straight on, or a corner while it turns."""
    robot = arena.robot
    return max(robot.speed, robot.turn * math.hypot(robot.length, robot.width) / 2)


def strides(arena: "Arena") -> int:
    """Into how many strides a physics step is divided, so that no point moves further than `deepest` in one."""
    return max(math.ceil(fastest(arena) * arena.motion.physics_step / deepest(arena) - 1e-9), 1)
