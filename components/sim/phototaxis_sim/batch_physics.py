"""Physics of many robots in one pymunk space: they collide with walls, but not with each other."""

import numpy as np
import pymunk
from phototaxis.geometry.arena import Arena
from phototaxis.geometry.substeps import max_move, max_overlap
from pymunk.batch import ArbiterFields, BodyFields, Buffer, get_space_arbiters, get_space_bodies, set_space_bodies

from phototaxis_sim.physics import Physics, Pose, add_robot, bring_to_rest, new_space, substep_of, undo_substep

_EACH_OTHER = pymunk.ShapeFilter(group=1)
_POSE = BodyFields.POSITION | BodyFields.ANGLE
_PUSH = BodyFields.FORCE | BodyFields.TORQUE
_REST = BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
_TOUCH = (
    ArbiterFields.BODY_A_ID | ArbiterFields.BODY_B_ID | ArbiterFields.CONTACT_COUNT
    | ArbiterFields.TOTAL_IMPULSE | ArbiterFields.POINT_A_1 | ArbiterFields.DISTANCE_1
    | ArbiterFields.POINT_A_2 | ArbiterFields.DISTANCE_2
)  # fmt: skip


class BatchPhysics:
    """N robots under the laws of `Physics`, moved together.

    Parameters
    ----------
    arena : the world.
    poses : the poses at which the robots start, at rest.

    Attributes
    ----------
    poses : (N, 3) x and y in m, heading in rad.
    front, rear : (N,) bool, where each was stopped in the last control period.
    """

    def __init__(self, arena: Arena, poses: list[Pose]):
        self._arena, self._count = arena, len(poses)
        self._one = Physics(arena) if arena.motion.collision == "stall" else None
        self._dt, self._steps = substep_of(arena)
        self._max_overlap, self._max_move = max_overlap(arena), max_move(arena)
        self._radius = np.hypot(arena.robot.length, arena.robot.width) / 2
        self._depth = np.full(self._count, -1.0)  # as in `Physics`
        self._space = new_space(arena)
        bodies = self._bodies = [self._add(pose) for pose in poses]
        self._mass, self._moment = bodies[0].mass, bodies[0].moment
        self._ids = np.array([body.id for body in bodies], np.uintp)
        self._order = np.argsort(self._ids)
        self._seen, self._felt, self._told = Buffer(), Buffer(), Buffer()  # reused, because pymunk never frees a buffer
        self.poses = np.array(poses, dtype=float)
        self.front = self.rear = np.zeros(self._count, bool)

    def drive(self, left: np.ndarray, right: np.ndarray) -> None:
        """Hold the wheel commands, (N,) in −1..1 each, for one control period."""
        robot = self._arena.robot
        speed, turn = robot.speed * (left + right) / 2, robot.turn * (right - left) / 2
        self.front, self.rear = np.zeros(self._count, bool), np.zeros(self._count, bool)
        if self._one is not None:
            self._stall(self._one, left, right)
        else:
            self._slide(speed, turn)

    def place(self, row: int, pose: Pose) -> None:
        """Put one robot at rest at a pose."""
        body = self._bodies[row]
        bring_to_rest(body, self._dt)
        body.position, body.angle = pose[:2], pose.heading
        self._space.remove(*body.shapes)  # with all contacts, as `Physics.place` has it
        self._space.add(*body.shapes)
        self.poses[row] = pose
        self.front[row] = self.rear[row] = False
        self._depth[row] = -1.0

    def _add(self, pose: Pose) -> pymunk.Body:
        body, box = add_robot(self._space, self._arena)
        box.filter = _EACH_OTHER
        body.position, body.angle = pose[:2], pose.heading
        self._space.reindex_shapes_for_body(body)
        return body

    def _stall(self, one: Physics, left: np.ndarray, right: np.ndarray) -> None:
        for row, (pose, *command) in enumerate(zip(self.poses.tolist(), left.tolist(), right.tolist(), strict=True)):
            one.place(Pose(*pose))
            self.poses[row], _, _, self.front[row], self.rear[row] = one.drive(*command)

    def _slide(self, speed: np.ndarray, turn: np.ndarray) -> None:
        """As `Physics` does it: one solve at rest, then solve and move in turn."""
        dt = self._dt
        push = np.zeros((self._count + 1, 3))  # the last row is the static body's
        ahead = self._mass * speed / dt
        push[:-1, 2] = self._moment * turn / dt
        self._set(_REST, np.zeros((self._count + 1, 3)))
        poses = self.poses
        for _ in range(self._steps + 1):
            before, touched = poses, self._depth >= 0
            angle = poses[:, 2]
            push[:-1, 0], push[:-1, 1] = ahead * np.cos(angle), ahead * np.sin(angle)
            self._set(_PUSH, push)
            self._space.step(dt)
            poses = self._get_poses()
            self._feel(poses)
            if touched.any():
                self._bring_back(touched, before, poses)
        poses[:, 2] -= 2 * np.pi * np.round(poses[:, 2] / (2 * np.pi))
        self.poses = poses

    def _bring_back(self, touched: np.ndarray, before: np.ndarray, poses: np.ndarray) -> None:
        """Undo the last substep of robots that a contact pushed too deep or too far, and update `poses`."""
        rows = np.flatnonzero(touched)
        step = poses[rows] - before[rows]
        step[:, 2] -= 2 * np.pi * np.round(step[:, 2] / (2 * np.pi))
        moved = np.hypot(step[:, 0], step[:, 1]) + self._radius * np.abs(step[:, 2])
        for row in rows[(self._depth[rows] > self._max_overlap) | (moved > self._max_move)].tolist():
            x, y, angle = before[row].tolist()
            undo_substep(self._bodies[row], (x, y), angle, self._dt)
            poses[row], self._depth[row] = before[row], 0.0

    def _set(self, fields: BodyFields, rows: np.ndarray) -> None:
        self._told.set_float_buf(rows)
        set_space_bodies(self._space, fields, self._told)

    def _get_poses(self) -> np.ndarray:
        self._seen.clear()
        get_space_bodies(self._space, _POSE, self._seen)
        return np.frombuffer(self._seen.float_buf()).reshape(-1, 3)[: self._count].copy()

    def _feel(self, poses: np.ndarray) -> None:
        """Note each robot's overlap, and whether its front or rear was stopped, in the last substep."""
        self._depth[:] = -1.0
        self._felt.clear()
        get_space_arbiters(self._space, _TOUCH, self._felt)
        ids = np.frombuffer(self._felt.int_buf(), np.uintp).reshape(-1, 3)
        floats = np.frombuffer(self._felt.float_buf()).reshape(-1, 8)
        if not len(ids):
            return
        found = np.searchsorted(self._ids, ids[:, :2], sorter=self._order) % self._count
        rows = self._order[found]
        mine = self._ids[rows] == ids[:, :2]
        row = np.where(mine[:, 0], rows[:, 0], rows[:, 1])
        points, there = floats[:, 2:].reshape(-1, 2, 3), np.arange(2) < ids[:, 2:]  # x, y, distance
        np.maximum.at(self._depth, row, np.where(there, np.maximum(-points[:, :, 2], 0.0), -1.0).max(axis=1))
        pressed = (floats[:, 0] != 0) | (floats[:, 1] != 0)  # an impulse: the robot is not just beside a wall
        if not pressed.any():
            return
        row, points, there = row[pressed], points[pressed], there[pressed]
        x, y, heading = poses[row].T[:, :, None]
        ahead = (points[:, :, 0] - x) * np.cos(heading) + (points[:, :, 1] - y) * np.sin(heading) >= 0
        np.logical_or.at(self.front, row, (ahead & there).any(axis=1))
        np.logical_or.at(self.rear, row, (~ahead & there).any(axis=1))
