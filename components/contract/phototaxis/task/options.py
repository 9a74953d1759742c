"""Command-line options that define the task: percept, reward and step cap."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from phototaxis.task.rewards import REWARDS, Reward, Scheme

OWN_REWARD: dict[str, Scheme] = {"simple": "difference", "rich": "static", "continuous": "potential"}
"""The default reward scheme of each percept: the paper's for its two, and a suitable one for "continuous"."""


class TaskOptions(Struct, kw_only=True):
    """Options that define the task."""

    percept: Literal["simple", "rich", "continuous"] = "simple"
    """what the learner perceives: 24 states or 400 states (both from the paper), or 12 real numbers"""
    reward: Literal["own", "difference", "static", "potential"] = "own"
    """reward scheme; own: the percept's default (simple: difference, rich: static, continuous: potential)"""
    max_episode_steps: Annotated[int, Meta(ge=1)] = 100
    """steps after which an episode is truncated while learning"""

    def scheme(self) -> Reward:
        """The reward function."""
        return REWARDS[OWN_REWARD[self.percept] if self.reward == "own" else self.reward]
