"""A run of many robots: the ticks, episodes and epochs of `Simulation` for N robots, each alone in its arena."""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from phototaxis.geometry.arena import Arena
from phototaxis.wire.codec import Refused
from phototaxis.wire.columns import COUNT, FLAG, pack, unpack
from phototaxis.wire.messages import ENDS, BatchState, End, EndedEpisode, State, World

from phototaxis_sim.batch_physics import BatchPhysics
from phototaxis_sim.physics import Physics, Pose

MAX_ROBOTS_PER_SPACE = 256
"""Most robots that share a pymunk space. They do not collide, but overlapping boxes slow the spatial index."""


class BatchSimulation:
    """N robots from tick to tick.

    Robot i is placed as in a run with the seed `seeds[i]`: seed + i unless other seeds are given. `starts` has the
    poses of those robots whose first episode starts elsewhere.

    Attributes
    ----------
    poses : (N, 3) x and y in m, heading in rad.
    front, rear : (N,) bool, contacts of the last control period.
    episode : (N,) count of each robot's episodes.
    state : the present tick as it is published, after `advance`; `Steps` fills in `driver`.
    outcomes : whether the light was reached, for each episode that ended in the last `advance`.
    ended : the first robot's episode that ended in the last `advance`, or None.
    """

    def __init__(
        self,
        arena: Arena,
        seed: int,
        run: str,
        epochs: int = 0,
        robots: int = 1,
        seeds: Sequence[int] | None = None,
        starts: Mapping[int, Pose] | None = None,
    ):
        self.world = World(run=run, arena=arena, seed=seed, epochs=epochs, robots=robots)
        self._seeds = [seed + row for row in range(robots)] if seeds is None else list(seeds)
        self._given = dict(starts or {})
        self._physics = Physics(arena)
        self.episode, self.tick, self.epoch = np.zeros(robots, int), 0, 0
        self.episodes = self.reached = 0
        self.outcomes: list[bool] = []
        self.ended: EndedEpisode | None = None
        self._began = 0
        first = [self._placement(row) for row in range(robots)]
        self._start = first[0]
        self._groups = [slice(start, start + MAX_ROBOTS_PER_SPACE) for start in range(0, robots, MAX_ROBOTS_PER_SPACE)]
        self._batches = [BatchPhysics(arena, first[group]) for group in self._groups]
        self._chain = b"\0" * 8
        self._motors = np.zeros((2, robots))
        self._look()
        self._report("")

    @property
    def finished(self) -> bool:
        """Whether the last epoch is done."""
        return 0 < self.world.epochs <= self.epoch

    def anew(self, seed: int, run: str) -> "BatchSimulation":
        """Another run in the same arena."""
        return BatchSimulation(self.world.arena, seed, run, self.world.epochs, self.world.robots)

    def advance(self, left: bytes | float, right: bytes | float, author: str, end: bytes | str = b"") -> BatchState:
        """Hold the commands for one control period; robots whose episode ends are placed anew instead.

        Columns as in `BatchCommand`; one number, or one word of `ENDS`, applies to all robots.

        Raises
        ------
        Refused
            when a column is not of this many robots, or a command is out of range.
        """
        motors, ends = self._columns(left, right, end)
        self.ended = self._ending(ENDS[ends[0]], author)
        self.drive(motors, ends)
        if self.ended is not None:
            self._began, self._start = self.tick, Pose(*self.poses[0].tolist())
        return self._report(author)

    def _ending(self, end: End, author: str) -> EndedEpisode | None:
        """The first robot's episode, if it ends now."""
        if not end:
            return None
        x, y, heading = self._start
        return EndedEpisode(
            run=self.world.run, episode=int(self.episode[0]), tick=self.tick, steps=self.tick - self._began,
            end=end, driver=author, x=x, y=y, heading=heading,
        )  # fmt: skip

    def snapshot(self, recent: list[bool], driver: str) -> None:
        """Return None: a run of many robots cannot be continued."""

    def check(self, command: Any) -> None:
        """Raise Refused when a column is not of this many robots, or a command is out of range."""
        self._columns(command.left, command.right, command.end)

    def _columns(self, left: bytes | float, right: bytes | float, end: bytes | str) -> tuple[np.ndarray, np.ndarray]:
        """Motors (2, N) and ends (N,)."""
        robots = self.world.robots
        motors = np.stack([self._column(left), self._column(right)])
        ends = np.full(robots, ENDS.index(end), FLAG) if isinstance(end, str) else unpack(end, robots, kind=FLAG)
        if not (np.abs(motors) <= 1).all() or (ends >= len(ENDS)).any():  # written so that NaN is refused too
            raise Refused("value: a command out of range")
        return motors, ends

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> None:
        """Do what `advance` does with arrays, motors (2, N) and ends (N,), but make no new `state`."""
        over = np.flatnonzero(ends)
        motors = self._motors = np.where(ends > 0, 0.0, motors)
        for group, batch in zip(self._groups, self._batches, strict=True):
            batch.drive(motors[0, group], motors[1, group])
        self.tick += 1
        self.epoch += self.world.robots - len(over)
        self.outcomes = (ends[over] == ENDS.index("terminated")).tolist()
        self.episodes += len(over)
        self.reached += sum(self.outcomes)
        self.renew(over)

    def renew(self, rows: np.ndarray) -> None:
        """Begin the next episode of some robots between two ticks; the others are not touched."""
        self.episode[rows] += 1
        for row in rows.tolist():
            self._batches[row // MAX_ROBOTS_PER_SPACE].place(row % MAX_ROBOTS_PER_SPACE, self._placement(row))
        self._look()

    def expect(self, row: int, seed: int | None = None, start: Pose | None = None) -> None:
        """Prepare a robot's next episode: the first one of another seed, or at a pose."""
        if seed is not None:
            self._seeds[row], self.episode[row] = seed, -1
        if start is not None:
            self._given[row] = start

    @property
    def watched(self) -> State:
        """The first robot, for people to watch."""
        state, (x, y, heading) = self.state, self.poses[0].tolist()
        return State(
            run=state.run, tick=state.tick, episode=int(self.episode[0]), epoch=state.epoch, time=state.time, x=x, y=y,
            heading=heading, speed=0.0, turn=0.0, front=bool(self.front[0]), rear=bool(self.rear[0]),
            left=float(self._motors[0][0]), right=float(self._motors[1][0]), author=state.author, driver=state.driver,
            hash=state.hash,
        )  # fmt: skip

    def _column(self, given: bytes | float) -> np.ndarray:
        robots = self.world.robots
        return unpack(given, robots) if isinstance(given, bytes) else np.full(robots, float(given))

    def _placement(self, row: int) -> Pose:
        """As `Simulation` has it: the pose that was given, else a function of (seed, episode)."""
        if row in self._given:
            return self._given.pop(row)
        return self._physics.random_pose(np.random.default_rng((self._seeds[row], int(self.episode[row]))))

    def _look(self) -> None:
        self.poses, self.front, self.rear = (
            np.concatenate([getattr(batch, name) for batch in self._batches]) for name in ("poses", "front", "rear")
        )

    def _report(self, author: str) -> BatchState:
        episode, pose = pack(self.episode, COUNT), pack(self.poses.T)
        contact, (left, right) = pack(np.stack([self.front, self.rear]), FLAG), map(pack, self._motors)
        digest = hashlib.blake2b(self._chain, digest_size=8)
        for column in (pack(np.array([self.tick, self.epoch]), COUNT), episode, pose, contact, left, right):
            digest.update(column)
        self._chain = digest.digest()
        seconds = self.tick * self.world.arena.motion.control_period
        self.state = BatchState(
            run=self.world.run, tick=self.tick, epoch=self.epoch, time=seconds, episode=episode, pose=pose,
            contact=contact, left=left, right=right, author=author, driver="", hash=digest.hexdigest(),
        )  # fmt: skip
        return self.state
