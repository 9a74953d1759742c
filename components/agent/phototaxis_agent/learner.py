"""What a learner is, and how one is found by its name."""

from importlib.metadata import EntryPoint, entry_points
from typing import Any, NamedTuple, Protocol

import numpy as np
from phototaxis.errors import UserError
from phototaxis.task import Percept, State

GROUP = "phototaxis.learners"


class Transition(NamedTuple):
    """One learning step."""

    state: State
    action: int
    """Index into `phototaxis.task.ACTIONS`."""
    reward: float
    following: State
    terminated: bool
    """The light was reached: nothing follows. (An episode cut short is not terminated.)"""
    progress: float
    """Share of the budget of learning steps that is used, 0..1: for rates that fall."""


class Learner(Protocol):
    """An action-value function that learns from transitions.

    Made as ``Learner(options, percept, rng)``; `Options` is the class of its hyperparameters, a msgspec
    Struct. All randomness comes from `rng`, so that a run can be repeated and continued.
    """

    Options: type[Any]

    def __init__(self, options: Any, percept: Percept, rng: np.random.Generator): ...

    def values(self, state: State) -> list[float]:
        """Q(state, a) of the actions that the percept allows, in the order of `percept.actions`."""
        ...

    def learn(self, transition: Transition) -> float:
        """Take in one transition; the temporal-difference error before the update."""
        ...

    def save(self) -> dict[str, np.ndarray]:
        """Everything learned, as named arrays."""
        ...

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        """Take over saved arrays; ValueError when they do not fit."""
        ...


def available() -> dict[str, EntryPoint]:
    """The learners that are installed, by name."""
    return {point.name: point for point in sorted(entry_points(group=GROUP))}


def find(name: str) -> type[Learner]:
    """The learner class called `name`.

    Raises
    ------
    UserError
        when there is none; it lists those that exist.
    """
    points = available()
    if name not in points:
        raise UserError(f"no learner '{name}'; there are: {', '.join(points) or 'none'}")
    return points[name].load()
