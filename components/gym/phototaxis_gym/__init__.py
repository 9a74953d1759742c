"""The task as Gymnasium environments: one robot, or many in one process.

Importing this registers them; `gymnasium.make("phototaxis/LightSeeker-v0")` finds them by their entry point.
"""

import gymnasium

CAP = 300
"""Steps after which an episode is truncated."""


def register() -> None:
    """Called by Gymnasium, within the namespace `phototaxis`."""
    gymnasium.register(
        "LightSeeker-v0",
        entry_point="phototaxis_gym.single:LightSeeker",
        vector_entry_point="phototaxis_gym.vector:LightSeekers",
    )
