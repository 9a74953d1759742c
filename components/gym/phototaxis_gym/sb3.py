"""Adapts the vector environment to Stable-Baselines3's own `VecEnv` interface."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

NAME = "phototaxis/LightSeeker-v0"


class Robots(VecEnv):
    """`num_envs` robots as a `VecEnv` of Stable-Baselines3, in this process or in a running system.

    It behaves like `DummyVecEnv` with as many single environments, but steps all robots together. Wrap it in
    `VecMonitor` to get the rewards and lengths of episodes.

    Parameters
    ----------
    num_envs : number of robots.
    options : the options of `LightSeekers`, except `autoreset_mode`.
    """

    def __init__(self, num_envs: int, **options: Any):
        mode = AutoresetMode.SAME_STEP
        self.robots: Any = gymnasium.make_vec(NAME, num_envs=num_envs, autoreset_mode=mode, **options)
        self.render_mode = options.get("render_mode")
        super().__init__(num_envs, self.robots.single_observation_space, self.robots.single_action_space)
        self._actions: Any = None

    def reset(self) -> Any:
        """Return the first observations; seeds and options from `seed` and `set_options` are used once."""
        seeds = None if None in self._seeds else self._seeds
        poses = [one["pose"] for one in self._options if "pose" in one]
        seen, info = self.robots.reset(seed=seeds, options={"pose": poses} if poses else None)
        self.reset_infos = rows(info, self.num_envs)
        self._reset_seeds()
        self._reset_options()
        return seen

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> Any:
        """Return observations, rewards, dones and infos; the info of an ended episode has its last observation."""
        seen, reward, terminated, truncated, info = self.robots.step(self._actions)
        over, infos = terminated | truncated, rows(info, self.num_envs)
        for row, one in enumerate(infos):
            one["TimeLimit.truncated"] = bool(truncated[row] and not terminated[row])
        for row in np.flatnonzero(over):
            final = {key: values[row] for key, values in info["final_info"].items() if not key.startswith("_")}
            infos[row].update(final, terminal_observation=info["final_obs"][row])
        return seen, reward.astype(np.float32), over, infos

    def close(self) -> None:
        self.robots.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        return self.robots.render()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.robots, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise AttributeError(f"{attr_name}: the robots are one environment, whose options are fixed")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        raise AttributeError(f"{method_name}: the robots are one environment; call its methods on `robots`")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * len(list(self._get_indices(indices)))


def rows(info: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """Split the `info` of a vector environment into one for each robot, without the entries of ended episodes."""
    keys = [key for key in info if not key.startswith(("_", "final_"))]
    return [{key: info[key][row] for key in keys} for row in range(count)]
