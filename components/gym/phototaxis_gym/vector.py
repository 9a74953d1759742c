"""Many robots as one vector environment, stepped together: in shared pymunk spaces and NumPy, or behind the bus."""

from collections import deque
from collections.abc import Sequence
from itertools import combinations
from typing import Any, Literal

import numpy as np
from gymnasium.error import Error, InvalidAction, ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from phototaxis.errors import UserError
from phototaxis.messages import ENDS
from phototaxis.task import EQUAL, STEPS, CrowdReadings, lit
from phototaxis_sim import arenas

from phototaxis_gym import CAP
from phototaxis_gym.place import ManyHere, Places
from phototaxis_gym.remote import ManyThere
from phototaxis_gym.spaces import MOTORS, actions, observation, rewards, valid_cap, valid_percept

SEEDS = 2**31
REACHED, CAPPED = ENDS.index("reached"), ENDS.index("cap")


class LightSeekers(VectorEnv[Any, Any, Any]):
    """The vector form of `LightSeeker`: the same options, spaces, rewards and ends for `num_envs` robots.

    Robot i begins with the placements of the seed `seed + i`, episode after episode (or of the i-th of several
    seeds). A robot whose episode has ended is placed anew by the next step, which ignores its action
    (`AutoresetMode.NEXT_STEP`). Sensor noise is that of the first seed. With `connect` the robots are those of a
    running system that was started with `--robots`.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - Gymnasium's form

    def __init__(
        self,
        num_envs: int = 1,
        percept: str = "simple",
        arena: str = "",
        reward: str = "own",
        action: Literal["discrete", "continuous"] = "discrete",
        cap: int = CAP,
        render_mode: str | None = None,
        connect: str = "",
        world: str = "phototaxis",
        timeout: float = 10.0,
    ):
        if render_mode is not None:
            raise Error(f"render_mode {render_mode}: many robots are not drawn; leave it out")
        if connect and arena:
            raise Error(f"arena '{arena}': that is the running system's; leave it out with connect")
        if num_envs < 1:
            raise Error(f"num_envs {num_envs}: at least one robot is needed")
        self.num_envs, self._cap = num_envs, valid_cap(cap)
        self._reward, self.single_action_space = rewards(reward, valid_percept(percept)), actions(action)
        try:
            self._place: Places = (
                ManyThere(connect, world, timeout, num_envs) if connect else ManyHere(arenas.enter(arena or "paper"))
            )
        except UserError as error:
            raise Error(str(error)) from None
        arena_ = self._place.arena
        self._observe = observation(percept, arena_)
        self.single_observation_space = self._observe.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._discrete = action == "discrete"
        self._readings: CrowdReadings | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of every robot; without a seed with placements that follow from the last seed."""
        count = self.num_envs
        super().reset(seed=seed if isinstance(seed, int) else None)
        first = int(self.np_random.integers(SEEDS)) if seed is None else seed
        given = [first + row for row in range(count)] if isinstance(first, int) else first
        seeds = [int(self.np_random.integers(SEEDS)) if one is None else one for one in given]
        if len(seeds) != count or min(seeds) < 0:
            raise Error(f"seed={seed}: one number, or one for each of the {count} robots; none below 0")
        self._episodes, self._steps = np.zeros(count, int), np.zeros(count, int)
        self._ends = np.zeros(count, np.uint8)
        self._memory = Memories(count)
        return self._look(self._place.begin(seeds)), self._info()

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Hold an action for one control period."""
        if self._readings is None:
            raise ResetNeeded("reset() comes before step()")
        motors, fresh = self._motors(np.asarray(actions)), self._ends > 0
        self._episodes += fresh
        self._steps = np.where(fresh, 0, self._steps + 1)
        self._memory.forget(np.flatnonzero(fresh))
        senses = self._place.drive(motors.T, self._ends)
        seen, memory = self._look(senses), self._memory
        reward = self._reward.many(np.maximum(*memory.before), senses, memory.unchanged)
        terminated, truncated = np.asarray(lit(senses)), self._steps >= self._cap
        for column in (reward, terminated, truncated):
            column[fresh] = 0
        self._ends = np.where(terminated, REACHED, np.where(truncated, CAPPED, 0)).astype(np.uint8)
        return seen, reward, terminated, truncated, self._info()

    def close_extras(self, **kwargs: Any) -> None:
        """Leave the world; `close` calls it."""
        self._place.close()

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

    def _look(self, senses: CrowdReadings) -> Any:
        self._readings = senses
        self._memory.see(senses)
        seen = self._observe(senses, self._memory)
        return np.asarray(seen, self.single_observation_space.dtype)

    def _info(self) -> dict[str, Any]:
        poses = self._place.poses
        return {**({} if poses is None else {"pose": poses}), "episode_number": self._episodes.copy()}


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
