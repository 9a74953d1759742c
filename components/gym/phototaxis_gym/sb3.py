"""Many robots for Stable-Baselines3, which has a vector environment of its own kind."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

NAME = "phototaxis/LightSeeker-v0"


class Robots(VecEnv):
    """`gymnasium.make_vec` of `num_envs` robots as Stable-Baselines3's `VecEnv`, here or in a running system.

    Does what its `DummyVecEnv` does with a loop over single robots, but steps all of them together. `VecMonitor`
    around it counts rewards and lengths of episodes.

    Parameters
    ----------
    num_envs : number of robots.
    options : those of `LightSeekers` but `autoreset_mode`.
    """

    def __init__(self, num_envs: int, **options: Any):
        mode = AutoresetMode.SAME_STEP
        self.robots: Any = gymnasium.make_vec(NAME, num_envs=num_envs, autoreset_mode=mode, **options)
        self.render_mode = options.get("render_mode")
        super().__init__(num_envs, self.robots.single_observation_space, self.robots.single_action_space)
        self._actions: Any = None

    def reset(self) -> Any:
        """The first observations; what `seed` and `set_options` were given is used once."""
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
        """Observations, rewards, ended episodes and infos, which have the last observation of an ended episode."""
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
    """The `info` of a vector environment as one for each robot, without what ended episodes leave."""
    keys = [key for key in info if not key.startswith(("_", "final_"))]
    return [{key: info[key][row] for key in keys} for row in range(count)]
