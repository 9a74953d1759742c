"""The Gymnasium vector environment, which steps many robots together, in this process or on the bus."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from gymnasium import logger
from gymnasium.error import Error, ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from phototaxis.runtime.errors import UserError
from phototaxis.task import BatchObservation, Episode
from phototaxis.task.episode import RESET
from phototaxis_sim import arenas

from phototaxis_gym import MAX_EPISODE_STEPS
from phototaxis_gym.backend import BatchBackend, LocalBatchBackend
from phototaxis_gym.draw import SIDE_PIXELS, Canvas, Window, frame_rate, tiles
from phototaxis_gym.errors import EpisodeOver
from phototaxis_gym.remote_many import RemoteBatchBackend
from phototaxis_gym.resets import given_poses, reset_mask, row_seeds, run_seed
from phototaxis_gym.spaces import actions, batch_motors, observer, rewards, valid_percept, valid_steps


class LightSeekers(VectorEnv[Any, Any, Any]):
    """The vector form of `LightSeeker`: the same options, spaces, rewards and ends for `num_envs` robots.

    It behaves like Gymnasium's SyncVectorEnv of as many `LightSeeker`s. In each episode robot i has the placement of
    the seed `seed + i`, or of the i-th seed of a list. The sensor noise comes from the first seed. With `connect` it
    drives the robots of a running system that was started with `--robots`.

    Parameters
    ----------
    max_episode_steps : steps after which an episode is truncated; −1 for no limit, None for 300.
    render_mode : None, "rgb_array" (`render` returns one picture for each robot) or "human" (all in one window).
    autoreset_mode : when a robot whose episode has ended begins a new one. NEXT_STEP: at the next step, which ignores
        its action. SAME_STEP: at once; `info` has "final_obs" and "final_info". DISABLED: when the caller calls
        `reset(options={"reset_mask": …})`. On the bus the last two take one more tick of the running system, in which
        the other robots stand still.
    disable_env_checker : has no effect, because Gymnasium has no checker for vector environments.
    """

    metadata = {  # noqa: RUF012 - Gymnasium's form
        "render_modes": ["rgb_array", "human"],
        "render_fps": 2,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        percept: str = "simple",
        arena: str = "",
        reward: str = "own",
        action: Literal["discrete", "continuous"] = "discrete",
        render_mode: str | None = None,
        connect: str = "",
        world: str = "phototaxis",
        timeout: float = 10.0,
        max_episode_steps: int | None = MAX_EPISODE_STEPS,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        disable_env_checker: bool | None = None,
    ):
        modes = [] if connect else self.metadata["render_modes"]
        if connect and (arena or render_mode):
            what = f"arena '{arena}'" if arena else f"render_mode '{render_mode}'"
            raise Error(f"{what}: the running system decides that; leave it out with connect")
        if render_mode is not None and render_mode not in modes:
            raise Error(f"no render_mode '{render_mode}' for many robots; there are: {', '.join(modes)}")
        if num_envs < 1:
            raise Error(f"num_envs {num_envs}: at least one robot is needed")
        steps = MAX_EPISODE_STEPS if max_episode_steps is None else max_episode_steps
        self._episode = Episode(np.inf if steps == -1 else valid_steps(steps), num_envs)
        self.num_envs = num_envs
        self._reward, self.single_action_space = rewards(reward, valid_percept(percept)), actions(action)
        self._mode, self.render_mode = AutoresetMode(autoreset_mode), render_mode
        try:
            self._backend: BatchBackend = (
                RemoteBatchBackend(connect, world, timeout, num_envs)
                if connect
                else LocalBatchBackend(arenas.load_checked(arena or "paper", goal=False))
            )
        except UserError as error:
            raise Error(str(error)) from None
        self._arena = self._backend.arena
        fps = frame_rate(self._arena)
        self.metadata = {"render_modes": modes, "render_fps": fps, "autoreset_mode": self._mode}
        self._observe = observer(percept, self._arena)
        self.single_observation_space = self._observe.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._window = Window(fps) if render_mode == "human" else None
        side = SIDE_PIXELS if self._window is None else max(2 * SIDE_PIXELS // int(np.ceil(np.sqrt(num_envs))), 1)
        self._canvas = Canvas(self._arena, min(side, SIDE_PIXELS)) if render_mode else None
        self._seeds: list[int] | None = None
        self._episodes, self._ends = np.zeros(num_envs, int), np.zeros(num_envs, np.uint8)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override] - a tuple, as in SyncVectorEnv
        """The seed of each robot; they are drawn now if there are none yet."""
        if self._seeds is None:
            first = seeding.np_random()[1]
            self._seeds = [first + row for row in range(self.num_envs)]
        return tuple(self._seeds)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of every robot, or of those in `options["reset_mask"]`.

        A robot without a seed goes on with its run. `options["pose"]` is one pose for all robots, shape (3,), or one
        for each, shape (N, 3): x and y in m, heading in rad.
        """
        count = self.num_envs
        mask, starts = reset_mask(options, count), given_poses(options, self._arena, count)
        rows, seeds = np.flatnonzero(mask).tolist(), row_seeds(seed, count)
        if self._episode.now is None and not mask.all():
            raise ResetNeeded("the first reset() must be of all robots; leave reset_mask out")
        known = self.np_random_seed
        used = [known[row] if one is None or not mask[row] else one for row, one in enumerate(seeds)]
        if mask.all() and (self._episode.now is None or None not in seeds):
            observation = self._backend.begin([run_seed(one) for one in used], starts)
            super().reset(seed=used[0])
            self._episodes = np.zeros(count, int)
            self._episode.begin(observation)
        else:
            new = {row: run_seed(used[row]) for row in rows if seeds[row] is not None}
            self._renew(mask, new, {row: start for row, start in starts.items() if mask[row]})
        self._seeds, self._ends[mask] = used, 0
        return self._look(), self._info(mask)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Hold an action for one control period."""
        if self._episode.now is None:
            raise ResetNeeded("call reset() before step()")
        motors = batch_motors(self.action_space, self.single_action_space, actions, self.num_envs)
        fresh = self._ends > 0
        if self._mode == AutoresetMode.DISABLED and fresh.any():
            over = np.flatnonzero(fresh).tolist()
            raise EpisodeOver(f"the episodes of the robots {over} have ended; call reset with a reset_mask first")
        self._episodes += fresh
        episode = self._episode
        episode.step(self._backend.drive(motors.T, self._ends))
        episode.begin(episode.now, fresh)
        seen, reward = self._look(), self._reward(episode)
        terminated, truncated = episode.terminated & ~fresh, episode.truncated
        self._ends = np.where(fresh, 0, episode.end).astype(np.uint8)
        info: dict[str, Any] = {}
        if self._mode == AutoresetMode.SAME_STEP and (over := self._ends > 0).any():
            rows = self._info(over)
            for row in np.flatnonzero(over).tolist():
                final = {key: rows[key][row] for key in rows if not key.startswith("_")}
                info = self._add_info(info, {"final_obs": seen[row], "final_info": final}, row)
            self._renew(over, {}, {})
            self._ends[over] = 0
            seen = self._look()
        return seen, reward, terminated, truncated, {**info, **self._info(np.ones(self.num_envs, bool))}

    def render(self) -> tuple[Any, ...]:
        """Return a picture of each robot, (height, width, 3) uint8; or show them in a window and return Nones."""
        if self._episode.now is None:
            raise ResetNeeded("call reset() before render()")
        if self._canvas is None:
            logger.warn("render() without a render_mode shows nothing; give gymnasium.make_vec one: 'rgb_array'")
            return (None,) * self.num_envs
        poses, sonar = np.asarray(self._backend.poses).tolist(), self._episode.now.sonar.T.tolist()
        pictures = tuple(self._canvas.draw(pose, rays) for pose, rays in zip(poses, sonar, strict=True))
        if self._window is None:
            return pictures
        self._window.show(tiles(pictures))
        return (None,) * self.num_envs

    def close_extras(self, **kwargs: Any) -> None:
        """Leave the world; `close` calls it."""
        self._backend.close()
        if self._window is not None:
            self._window.close()

    def _renew(self, mask: np.ndarray, seeds: dict[int, int], starts: dict[int, Any]) -> None:
        """Begin new episodes of the robots in `mask`; the others keep their observations."""
        ends = np.where(mask, np.where(self._ends > 0, self._ends, RESET), 0).astype(np.uint8)
        pairs = zip(self._backend.renew(ends, seeds, starts), self._episode.now, strict=True)
        self._episode.begin(BatchObservation(*(np.where(mask, new, old) for new, old in pairs)), mask)
        self._episodes[mask] += 1
        self._episodes[list(seeds)] = 0

    def _look(self) -> Any:
        """Return the observations, after showing them in the window if there is one."""
        if self._window is not None:
            self.render()
        return np.asarray(self._observe(self._episode.now, self._episode.history), self.single_observation_space.dtype)

    def _info(self, mask: np.ndarray) -> dict[str, Any]:
        """Return the `info` of the robots in `mask` as SyncVectorEnv does: an array and a mask for each key."""
        poses, count = self._backend.poses, self.num_envs
        columns = {} if poses is None else {"pose": poses.copy()}
        columns["tick"] = np.full(count, self._backend.tick)
        columns["episode_number"] = self._episodes.copy()
        columns["is_success"] = self._episode.terminated
        return {**columns, **{f"_{key}": mask.copy() for key in columns}}
