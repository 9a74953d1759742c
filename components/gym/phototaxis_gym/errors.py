"""Errors with the names that Gymnasium gives them, which are also of the types that its own environments raise."""

from gymnasium.error import Error, InvalidAction, ResetNeeded


class WrongAction(InvalidAction, AssertionError):
    """An action lies outside the action space; CartPole asserts that it does not."""


class WrongCount(InvalidAction, ValueError):
    """There are more or fewer actions than robots."""


class WrongSeeds(Error, ValueError):
    """There are more or fewer seeds than robots."""


class WrongSteps(Error, ValueError):
    """An episode would have no steps; `gymnasium.make` raises ValueError for it."""


class EpisodeOver(ResetNeeded, AssertionError):
    """A robot whose episode has ended was stepped with `AutoresetMode.DISABLED`; SyncVectorEnv asserts the same."""
