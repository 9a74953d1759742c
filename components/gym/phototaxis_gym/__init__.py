"""The task as Gymnasium environments: one robot, or many in one process.

Importing this registers them. Gymnasium does so itself when the name says where from:
`gymnasium.make("phototaxis_gym:phototaxis/LightSeeker-v0")`.
"""

import gymnasium

MAX_EPISODE_STEPS = 300
"""Steps after which an episode is truncated, unless `max_episode_steps` says otherwise."""

gymnasium.register(
    "phototaxis/LightSeeker-v0",
    entry_point="phototaxis_gym.single:LightSeeker",
    vector_entry_point="phototaxis_gym.vector:LightSeekers",
    max_episode_steps=MAX_EPISODE_STEPS,
)
