"""Moves a differential-drive robot among walls; pymunk resolves the collisions.

The robot is overdamped: in each physics step the solver starts from the velocity that the wheels ask
for and takes away what the contacts forbid, so that the body is stopped by a wall and slides along it.
A physics step that could take the body through a thin wall is divided into substeps. A substep is undone if the
solver pushes the body too far in it, for instance between two walls.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import pymunk
from phototaxis.geometry.arena import Arena
from phototaxis.geometry.substeps import max_move, max_overlap, substeps
from phototaxis.runtime.errors import UserError
from phototaxis_world.shapes import static_shapes

_ROBOT = 1
_FAR_M = -100_000.0
_MAX_TRIES = 10_000
_MASS_KG = 10.0
_GRIP = 100.0
"""How much harder the wheels make it for a contact to turn the body (times the body's own inertia)."""


class Pose(NamedTuple):
    """Position in metres, heading in radians."""

    x: float
    y: float
    heading: float


class DriveResult(NamedTuple):
    """The robot's pose, speeds and contacts after a control period."""

    pose: Pose
    speed: float
    turn: float
    front: bool
    rear: bool


def new_space(arena: Arena) -> pymunk.Space:
    """A space with everything in it that does not move."""
    space = pymunk.Space()
    space.damping = 0.0  # velocity is what the force of this step makes it: no inertia
    space.collision_slop = 0.001
    space.collision_bias = 1e-6
    space.iterations = 20
    for shape in static_shapes(arena, space.static_body):
        shape.friction = arena.motion.friction
        space.add(shape)
    return space


def add_robot(space: pymunk.Space, arena: Arena) -> tuple[pymunk.Body, pymunk.Poly]:
    """Add the robot's body."""
    size = (arena.robot.length, arena.robot.width)
    body = pymunk.Body(_MASS_KG, _GRIP * pymunk.moment_for_box(_MASS_KG, size))
    box = pymunk.Poly.create_box(body, size)
    box.collision_type = _ROBOT
    box.friction = arena.motion.friction
    space.add(body, box)
    return body, box


def substep_of(arena: Arena) -> tuple[float, int]:
    """Seconds of one substep of the solver, and how many of them make one control period."""
    count = substeps(arena)
    return arena.motion.physics_step / count, arena.physics_steps * count


def undo_substep(body: pymunk.Body, position: tuple[float, float], angle: float, dt: float) -> None:
    """Put a body back to where a substep began, at rest."""
    bring_to_rest(body, dt)
    body.position, body.angle = position, angle


def bring_to_rest(body: pymunk.Body, dt: float) -> None:
    """Bring a body to rest, and clear the velocity that the solver keeps to push it out of a wall."""
    body.velocity, body.angular_velocity = (0, 0), 0
    pymunk.Body.update_position(body, dt)


class Physics:
    """The arena and the robot's body in one pymunk space.

    What follows a `place` depends on the pose and the commands alone, never on earlier episodes.

    Raises
    ------
    UserError
        when a wall, a polygon or the robot has no extent.
    """

    def __init__(self, arena: Arena):
        self._arena, self._robot = arena, arena.robot
        self._dt, self._steps = substep_of(arena)
        self._substeps = substeps(arena)
        self._max_overlap, self._max_move = max_overlap(arena), max_move(arena)
        self._depth = -1.0
        """How deep the body overlapped something after the last substep, m; −1 where it touched nothing."""
        self._stall = arena.motion.collision == "stall"
        self._front = self._rear = False
        space = self._space = new_space(arena)
        self._body, self._box = add_robot(space, arena)
        self._moment = self._body.moment
        size = (self._robot.length, self._robot.width)
        self._radius = math.hypot(*size) / 2
        clear = arena.placement.clearance
        self._probe = pymunk.Poly.create_box(None, (size[0] + 2 * clear, size[1] + 2 * clear))
        space.on_collision(_ROBOT, None, post_solve=self._touched)

    def place(self, pose: Pose) -> DriveResult:
        """Put the robot at rest at a pose."""
        body, space = self._body, self._space
        for x, y, heading in ((_FAR_M, _FAR_M, 0.0), pose):  # far away all contacts expire
            body.position, body.angle = (x, y), heading
            body.velocity, body.angular_velocity = (0, 0), 0
            space.reindex_shapes_for_body(body)
            for _ in range(int(space.collision_persistence) + 1):
                self._depth = -1.0
                space.step(self._dt)
        self._front = self._rear = False
        return DriveResult(pose, 0.0, 0.0, False, False)

    def free(self, pose: Pose) -> bool:
        """Whether the robot, with the placement's clearance around it, touches nothing at a pose."""
        width, height = self._arena.size
        if not (0 < pose.x < width and 0 < pose.y < height):
            return False
        return not self._hits(self._probe, pose)

    def random_pose(self, rng: np.random.Generator) -> Pose:
        """A free pose, uniform over the room, far enough from every light.

        Raises
        ------
        UserError
            when 10,000 tries find none.
        """
        return self.sample(rng, 1)[0][0]

    def sample(self, rng: np.random.Generator, count: int) -> tuple[list[Pose], float]:
        """At most `count` free poses as in `random_pose`, out of 10,000 tries; the share of the tries that were free.

        Raises
        ------
        UserError
            when there was none.
        """
        width, height = self._arena.size
        away, found = self._arena.placement.light_distance, list[Pose]()
        for tried in range(1, _MAX_TRIES + 1):
            u, v, w = rng.random(3).tolist()
            pose = Pose(u * width, v * height, (2 * w - 1) * math.pi)
            distances = (math.dist(pose[:2], light.position) for light in self._arena.lights)
            if min(distances) >= away and self.free(pose):
                found.append(pose)
                if len(found) == count:
                    return found, count / tried
        if found:
            return found, len(found) / _MAX_TRIES
        raise UserError(
            f"arena {self._arena.name}: the robot ({self._robot.length} × {self._robot.width} m) fits nowhere: no free "
            f"place {away} m from the lights in {_MAX_TRIES} tries; make room, or lower placement.light_distance or "
            f"placement.clearance"
        )

    def drive(self, left: float, right: float) -> DriveResult:
        """Hold a wheel command (−1..1 each) for one control period."""
        self._front = self._rear = False
        speed = self._robot.speed * (left + right) / 2
        turn = self._robot.turn * (right - left) / 2
        return self._refuse_contact(speed, turn) if self._stall else self._slide(speed, turn)

    def _slide(self, speed: float, turn: float) -> DriveResult:
        """One solve at rest, so that old contacts meet the new command, then solve and move in turn."""
        body, step, dt = self._body, self._space.step, self._dt
        push, torque = _MASS_KG * speed / dt, self._moment * turn / dt
        body.velocity, body.angular_velocity = (0, 0), 0
        for _ in range(self._steps + 1):
            angle = body.angle
            before = body.position if self._depth >= 0 else None  # else no contact can push it
            self._depth = -1.0
            body.force = push * math.cos(angle), push * math.sin(angle)
            body.torque = torque
            step(dt)
            if before is not None and self._astray(before, angle):
                undo_substep(body, before, angle, dt)
                self._depth = 0.0
        angle = body.angle
        vx, vy = body.velocity
        x, y = body.position
        forward = vx * math.cos(angle) + vy * math.sin(angle)
        heading = math.remainder(angle, math.tau)
        return DriveResult(Pose(x, y, heading), forward, body.angular_velocity, self._front, self._rear)

    def _astray(self, before: tuple[float, float], angle: float) -> bool:
        """Whether the solver has pushed the body too deep into something, or too far in one substep."""
        moved = math.dist(before, self._body.position) + self._radius * abs(self._body.angle - angle)
        return self._depth > self._max_overlap or moved > self._max_move

    def _refuse_contact(self, speed: float, turn: float) -> DriveResult:
        """A physics step that would touch anything is not made at all (the Pyro simulator's stall)."""
        pose = Pose(*self._body.position, self._body.angle)
        moved = True
        for _ in range(self._arena.physics_steps):
            ahead = self._ahead(pose, speed, turn)
            moved = ahead is not None
            if ahead is not None:
                pose = ahead
            else:
                self._front |= speed > 0 or (speed == 0 and turn != 0)
                self._rear |= speed < 0
        x, y, angle = pose
        self._body.position, self._body.angle = (x, y), angle
        heading = math.remainder(angle, math.tau)
        at_end = (speed, turn) if moved else (0.0, 0.0)
        return DriveResult(Pose(x, y, heading), *at_end, self._front, self._rear)

    def _ahead(self, pose: Pose, speed: float, turn: float) -> Pose | None:
        """Where a physics step leads, substep by substep; None when one of them would touch anything."""
        for _ in range(self._substeps):
            x, y, angle = pose
            heading = angle + turn * self._dt
            middle = (angle + heading) / 2
            ahead = speed * self._dt
            pose = Pose(x + ahead * math.cos(middle), y + ahead * math.sin(middle), heading)
            if self._hits(self._box, pose):
                return None
        return pose

    def _hits(self, shape: pymunk.Poly, pose: Pose) -> bool:
        """Whether a box of the robot's kind would touch a static shape at a pose."""
        transform = pymunk.Transform(
            math.cos(pose.heading),
            math.sin(pose.heading),
            -math.sin(pose.heading),
            math.cos(pose.heading),
            *pose[:2],
        )
        test = pymunk.Poly(pymunk.Body(body_type=pymunk.Body.KINEMATIC), shape.get_vertices(), transform)
        return any(hit.shape is not self._box for hit in self._space.shape_query(test))

    def _touched(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        points = arbiter.contact_point_set.points
        for point in points:
            self._depth = max(self._depth, -point.distance, 0.0)
        if not arbiter.total_impulse:  # no impulse: the robot moves along a wall or away from it
            return
        for point in points:
            if self._body.world_to_local(point.point_a).x >= 0:
                self._front = True
            else:
                self._rear = True
