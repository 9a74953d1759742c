"""Errors of two types: Gymnasium's own class for the case, and the type that its own environments raise."""

from gymnasium.error import Error, InvalidAction, ResetNeeded


class WrongAction(InvalidAction, AssertionError):
    """An action lies outside the action space; CartPole raises AssertionError for it."""


class WrongCount(InvalidAction, ValueError):
    """There are more or fewer actions than robots."""


class WrongSeeds(Error, ValueError):
    """There are more or fewer seeds than robots."""


class WrongSteps(Error, ValueError):
    """`max_episode_steps` is below 1; `gymnasium.make` raises ValueError for it."""


class EpisodeOver(ResetNeeded, AssertionError):
    """A robot was stepped after its episode, with `AutoresetMode.DISABLED`; SyncVectorEnv raises AssertionError."""
