"""The task as Gymnasium environments: one robot, or many in one process.

Importing this registers them. Gymnasium does so itself when the name says where from:
`gymnasium.make("phototaxis_gym:phototaxis/LightSeeker-v0")`.
"""

from typing import Any

import gymnasium
from gymnasium.envs.registration import WrapperSpec

CAP = 300
"""Steps after which an episode is truncated, unless `cap` or `max_episode_steps` says otherwise."""


def with_cap(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """The environment with a `cap` above the usual limit in the place of that limit; `gymnasium.make` calls this."""
    from gymnasium.wrappers import TimeLimit

    cap = getattr(env.unwrapped, "cap", None) or 0
    usual = isinstance(env, TimeLimit) and env.spec is not None and env.spec.max_episode_steps == CAP
    return TimeLimit(env.env, cap) if usual and cap > CAP else env


gymnasium.register(
    "phototaxis/LightSeeker-v0",
    entry_point="phototaxis_gym.single:LightSeeker",
    vector_entry_point="phototaxis_gym.vector:LightSeekers",
    max_episode_steps=CAP,
    additional_wrappers=(WrapperSpec("WithCap", "phototaxis_gym:with_cap", {}),),
)
