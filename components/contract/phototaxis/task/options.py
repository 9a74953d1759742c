"""What is to be learned, as options of a command line."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from phototaxis.task.rewards import REWARDS, Reward, Scheme

OWN_REWARD: dict[str, Scheme] = {"simple": "difference", "rich": "static", "continuous": "potential"}
"""The scheme that the paper gave each of its percepts, and the one that suits the third."""


class TaskOptions(Struct, kw_only=True):
    """What is to be learned."""

    percept: Literal["simple", "rich", "continuous"] = "simple"
    """what the learner sees: 24 states, 400 states (both the paper's), or 12 real numbers"""
    reward: Literal["own", "difference", "static", "potential"] = "own"
    """reward scheme; own: the percept's (simple: difference, rich: static, continuous: potential)"""
    max_episode_steps: Annotated[int, Meta(ge=1)] = 100
    """steps after which an episode is truncated while learning"""

    def scheme(self) -> Reward:
        """The reward function."""
        return REWARDS[OWN_REWARD[self.percept] if self.reward == "own" else self.reward]
