"""Many robots as one vector environment, stepped together: shared pymunk spaces, the rest in NumPy."""

from collections import deque
from collections.abc import Sequence
from itertools import combinations
from typing import Any, Literal

import numpy as np
from gymnasium.error import Error, InvalidAction, ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from phototaxis.errors import UserError
from phototaxis.messages import World
from phototaxis.task import EQUAL, STEPS, CrowdReadings, lit
from phototaxis_sensors.crowd import CrowdSuite
from phototaxis_sim import arenas
from phototaxis_sim.crowd import Crowd
from phototaxis_sim.physics import Physics, Pose

from phototaxis_gym import CAP
from phototaxis_gym.spaces import MOTORS, actions, observation, rewards

TOGETHER = 256
"""Robots that share a pymunk space: they overlap without touching, which its index pays for."""
SEEDS = 2**31


class LightSeekers(VectorEnv[Any, Any, Any]):
    """The vector form of `LightSeeker`: the same options, spaces, rewards and ends for `num_envs` robots.

    Robot i begins with the placements of the seed `seed + i`, episode after episode (or of the i-th of several
    seeds). A robot whose episode has ended is placed anew by the next step, which ignores its action
    (`AutoresetMode.NEXT_STEP`). Sensor noise is that of the first seed.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - Gymnasium's form

    def __init__(
        self,
        num_envs: int = 1,
        percept: str = "simple",
        arena: str = "paper",
        reward: str = "own",
        action: Literal["discrete", "continuous"] = "discrete",
        cap: int = CAP,
        render_mode: str | None = None,
    ):
        if render_mode is not None:
            raise Error(f"render_mode {render_mode}: many robots are not drawn; leave it out")
        try:
            self._arena = arenas.load(arena)
        except UserError as error:
            raise Error(str(error)) from None
        self.num_envs, self._cap = num_envs, cap
        self._observe, self._reward = observation(percept, self._arena), rewards(reward, percept)
        self.single_observation_space, self.single_action_space = self._observe.space, actions(action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._discrete = action == "discrete"
        self._physics = Physics(self._arena)
        self._crowds: list[Crowd] = []
        self._groups = [slice(start, start + TOGETHER) for start in range(0, num_envs, TOGETHER)]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of every robot; without a seed with placements that follow from the last seed."""
        count = self.num_envs
        super().reset(seed=seed if isinstance(seed, int) else None)
        given = [None] * count if seed is None else [seed + i for i in range(count)] if isinstance(seed, int) else seed
        self._seeds = [int(self.np_random.integers(SEEDS)) if one is None else one for one in given]
        self._episodes, self._steps = np.zeros(count, int), np.zeros(count, int)
        self._ended = np.zeros(count, bool)
        self._tick = 0
        self._suite = CrowdSuite(World("gymnasium", self._arena, self._seeds[0], 0))
        self._memory = Memories(count)
        starts = [self._placement(row) for row in range(count)]
        self._crowds = [Crowd(self._arena, starts[group]) for group in self._groups]
        return self._look(), self._info()

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Hold an action for one control period."""
        if not self._crowds:
            raise ResetNeeded("reset() comes before step()")
        motors = self._motors(np.asarray(actions))
        fresh = np.flatnonzero(self._ended)
        motors[fresh] = 0.0
        for group, crowd in zip(self._groups, self._crowds, strict=True):
            crowd.drive(motors[group, 0], motors[group, 1])
        self._tick += 1
        self._steps += 1
        if len(fresh):
            self._begin(fresh)
        seen = self._look()
        senses, memory = self._readings, self._memory
        reward = self._reward.many(np.maximum(*memory.before), senses, memory.unchanged)
        terminated, truncated = np.asarray(lit(senses)), self._steps >= self._cap
        for column in (reward, terminated, truncated):
            column[fresh] = 0
        self._ended = terminated | truncated
        return seen, reward, terminated, truncated, self._info()

    def _motors(self, given: np.ndarray) -> np.ndarray:
        """The wheels' commands (N, 2) of a batch of actions."""
        if self._discrete:
            good = given.shape == (self.num_envs,) and given.dtype.kind in "iu"
            if not good or (given < 0).any() or (given >= len(MOTORS)).any():
                raise InvalidAction(f"{given!r} is not in {self.action_space}")
            return MOTORS[given]
        if given.shape != (self.num_envs, 2) or not (np.abs(given) <= 1).all():
            raise InvalidAction(f"{given!r} is not in {self.action_space}")
        return given.astype(float)

    def _begin(self, rows: np.ndarray) -> None:
        """Place robots at the start of their next episodes."""
        self._episodes[rows] += 1
        self._steps[rows] = 0
        self._memory.forget(rows)
        for row in rows.tolist():
            self._crowds[row // TOGETHER].place(row % TOGETHER, self._placement(row))

    def _placement(self, row: int) -> Pose:
        """As `Simulation` has it: a function of (seed, episode)."""
        return self._physics.random_pose(np.random.default_rng((self._seeds[row], int(self._episodes[row]))))

    def _look(self) -> Any:
        poses, front, rear = (
            np.concatenate([getattr(crowd, name) for crowd in self._crowds]) for name in ("poses", "front", "rear")
        )
        self._poses = poses
        self._readings = CrowdReadings(*self._suite(self._tick, poses), front, rear)
        self._memory.see(self._readings)
        seen = self._observe(self._readings, self._memory)
        return np.asarray(seen, self.single_observation_space.dtype)

    def _info(self) -> dict[str, Any]:
        return {"pose": self._poses, "episode_number": self._episodes.copy()}


class Memories:
    """`Memory` of N robots whose episodes begin at different times."""

    def __init__(self, count: int):
        self._lights: deque[np.ndarray] = deque(maxlen=STEPS)
        self._age = np.zeros(count, int)

    def forget(self, rows: np.ndarray) -> None:
        """Begin new episodes."""
        self._age[rows] = 0

    def see(self, senses: CrowdReadings) -> None:
        """Remember the readings of one step."""
        self._lights.append(senses.light)
        self._age += 1

    @property
    def before(self) -> np.ndarray:
        """(2, N): the readings of the step before; at the first step those of that step."""
        now = self._lights[-1]
        return np.where(self._age > 1, self._lights[-2], now) if len(self._lights) > 1 else now

    @property
    def unchanged(self) -> np.ndarray:
        """(N,): whether the light has not changed in 5 consecutive steps of the episode."""
        same = self._age >= STEPS
        if not same.any():
            return same
        for one, other in combinations(self._lights, 2):
            same = same & (np.abs(one - other) <= EQUAL).all(axis=0)
        return same
