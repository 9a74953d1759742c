"""Gymnasium environments of the task, for one robot or many.

Importing this package registers them. Gymnasium imports it by itself if the name includes the package:
`gymnasium.make("phototaxis_gym:phototaxis/LightSeeker-v0")`.
"""

import gymnasium

MAX_EPISODE_STEPS = 300
"""Default of `max_episode_steps`, the number of steps after which an episode is truncated."""

gymnasium.register(
    "phototaxis/LightSeeker-v0",
    entry_point="phototaxis_gym.single:LightSeeker",
    vector_entry_point="phototaxis_gym.vector:LightSeekers",
    max_episode_steps=MAX_EPISODE_STEPS,
)
