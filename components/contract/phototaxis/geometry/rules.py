"""Rules that an arena must obey beyond its types; an error names the key, what is expected and what was found.

`Arena` checks them whenever one is made: from a file, a message or a program. Suspicious but valid arenas are found
by the simulation, which can place a robot and try.
"""

import math
from collections.abc import Iterator
from itertools import chain, pairwise

import numpy as np

from phototaxis.geometry.arena import Arena, Point, Polygon
from phototaxis.geometry.sight import LAMP_CLEARANCE_M
from phototaxis.geometry.solids import distance, extent, solids, thickness
from phototaxis.geometry.substeps import max_overlap, max_speed, substeps, thinnest

MIN_THICKNESS_M = 0.002
"""Least thickness of an obstacle, m: twice the overlap that the solver leaves in a contact."""
MIN_ROBOT_SIDE_M = 0.01
"""Least length and width of the robot, m."""
MAX_SUBSTEPS = 10_000
"""Most solver steps in one control period."""


def check(arena: Arena) -> None:
    """Raise ValueError with the first rule that an arena breaks, in one line: `KEY: expected …`."""
    rules = _name, _obstacles, _robot, _motion, _sensors, _lights
    for broken in chain.from_iterable(rule(arena) for rule in rules):
        raise ValueError(broken)


def _name(arena: Arena) -> Iterator[str]:
    if not arena.name.isprintable() or not arena.name.strip():
        yield f"name: expected printable characters, got {arena.name!r}"


def _obstacles(arena: Arena) -> Iterator[str]:
    for index, wall in enumerate(arena.walls):
        if math.dist(wall.start, wall.end) < MIN_THICKNESS_M / 2:
            where = f"start is {list(wall.start)}, end {list(wall.end)}"
            yield f"walls[{index}]: expected two different points, {MIN_THICKNESS_M / 2} m apart or more; {where}"
    for index, polygon in enumerate(arena.polygons):
        if not _convex(polygon):
            yield f"polygons[{index}].corners: expected a convex polygon without corners on a line, each corner once"
    for key, solid in solids(arena):
        if (thick := thickness(solid)) < MIN_THICKNESS_M:
            yield f"{key}: expected an obstacle at least {MIN_THICKNESS_M} m thick, got {thick:.3g} m"


def _convex(polygon: Polygon) -> bool:
    """Whether all corners turn the same way, and once around in all (a star turns twice)."""
    corners = polygon.corners
    sides = [(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise([*corners, corners[0]])]
    turns = [math.atan2(ax * by - ay * bx, ax * bx + ay * by) for (ax, ay), (bx, by) in pairwise([*sides, sides[0]])]
    return len({math.copysign(1, turn) for turn in turns}) == 1 and 0 not in turns and abs(sum(turns)) < 3 * math.pi


def _robot(arena: Arena) -> Iterator[str]:
    robot = arena.robot
    for key, side in (("length", robot.length), ("width", robot.width)):
        if side < MIN_ROBOT_SIDE_M:
            yield f"robot.{key}: expected at least {MIN_ROBOT_SIDE_M} m, got {side}"
    clear = 2 * arena.placement.clearance
    if not _fits((robot.length, robot.width), arena.size):
        key = "length" if robot.length >= robot.width else "width"
        yield f"robot.{key}: {robot.length} × {robot.width} m fits nowhere in a room of {_room(arena)}"
    elif not _fits((robot.length + clear, robot.width + clear), arena.size):
        yield f"placement.clearance: with {clear / 2} m around it the robot fits nowhere in a room of {_room(arena)}"


def _fits(box: Point, room: Point) -> bool:
    """Whether a rectangle fits into another at some angle (J. Wetzel, Mathematics Magazine 73, 2000)."""
    p, q = max(box), min(box)
    a, b = max(room), min(room)
    if p <= a:
        return q <= b
    diagonal = p * p + q * q
    return q <= b and b * diagonal >= 2 * p * q * a + (p * p - q * q) * math.sqrt(diagonal - a * a)


def _room(arena: Arena) -> str:
    return f"{arena.size[0]} × {arena.size[1]} m"


def _motion(arena: Arena) -> Iterator[str]:
    motion, robot = arena.motion, arena.robot
    period, step = motion.control_period, motion.physics_step
    if period > MAX_SUBSTEPS * step:
        yield f"motion.physics_step: expected at least {period / MAX_SUBSTEPS:g} s of a control period of {period} s"
    elif arena.physics_steps < 1 or abs(arena.physics_steps * step - period) > 1e-9 * period:
        yield f"motion.physics_step: expected a whole fraction of control_period = {period}, got {step}"
    elif arena.physics_steps * substeps(arena) > MAX_SUBSTEPS:
        key = "speed" if robot.speed == max_speed(arena) else "turn"
        most = getattr(robot, key) * MAX_SUBSTEPS * max_overlap(arena) / (max_speed(arena) * period)
        thin, where = thinnest(arena)
        why = f"and {where}, {thin:.3g} m through" if thin == max_overlap(arena) else "and a robot of this size"
        yield f"robot.{key}: expected at most {most:.3g} with a control period of {period} s {why}"


def _sensors(arena: Arena) -> Iterator[str]:
    robot, room = arena.robot, math.hypot(*arena.size)
    places = [(f"robot.light_sensors[{index}]", place) for index, place in enumerate(robot.light_sensors)]
    places += [(f"robot.sonars[{index}].position", sonar.position) for index, sonar in enumerate(robot.sonars)]
    for key, place in places:
        if math.hypot(*place) >= room:
            yield f"{key}: {list(place)} from the robot's middle is always outside a room of {_room(arena)}"
    if arena.sensing.near > robot.sonar_range:
        yield (
            f"sensing.near: expected at most robot.sonar_range = {robot.sonar_range}, got {arena.sensing.near}: "
            f"obstacles would be reported everywhere"
        )


def _lights(arena: Arena) -> Iterator[str]:
    width, height = arena.size
    away = arena.placement.light_distance
    named = list(solids(arena))
    x0, y0, x1, y1 = np.array([extent(solid) for _, solid in named]).reshape(-1, 4).T
    for index, light in enumerate(arena.lights):
        x, y = light.position
        key = f"lights[{index}].position"
        if not (0 <= x <= width and 0 <= y <= height):
            yield f"{key}: expected a place inside the room, 0..{width} × 0..{height}"
        for at in np.flatnonzero((x0 < x) & (x < x1) & (y0 < y) & (y < y1)).tolist():
            where, solid = named[at]
            if distance(solid, np.array(x), np.array(y)) < 1e-9 - LAMP_CLEARANCE_M:
                yield f"{key}: {list(light.position)} is inside {where}, where no sensor can see it"
        if (most := math.hypot(max(x, width - x), max(y, height - y))) < away:
            yield f"placement.light_distance: no place in the room is {away} m from lights[{index}]; at most {most:.3g}"
