"""The base class of learners, and how a learner is found by its name."""

import sys
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint, entry_points
from typing import Any, ClassVar, NamedTuple

import numpy as np
from msgspec import Struct
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.phrases import known, told
from phototaxis.task import PERCEPTS, Percept, PerceptState

LEARNER_GROUP = "phototaxis.learners"
POLICY_GROUP = "phototaxis.policies"
INSTALL_HINTS = {LEARNER_GROUP: "'phototaxis[agent]'", POLICY_GROUP: "'phototaxis[gym]' stable-baselines3"}
"""What to install with pip for the entry points of Phototaxis, by entry-point group."""


class Transition(NamedTuple):
    """One learning step."""

    state: PerceptState
    action: int
    """Index into `phototaxis.task.ACTIONS`."""
    reward: float
    next_state: PerceptState
    terminated: bool
    """Whether the light was reached, so that no further reward follows. (A truncated episode is not terminated.)"""
    progress: float
    """Share of the budget of learning steps used so far, 0..1, from which falling rates are computed."""
    first: bool
    """Whether it does not continue the last transition: an episode begins, or steps were missed."""


class Learner:
    """An action-value function that learns from transitions.

    A learner subclasses this and is made as ``Learner(options, percept, rng)``; `Options` is the class of
    its hyperparameters, a msgspec Struct. All randomness comes from `rng`, so that a run can be repeated
    and continued. A state is the percept's, followed by the learner's own `context`.
    """

    Options: type[Any]
    presets: ClassVar[dict[str, dict[str, Any]]] = {}
    """Defaults of options (any of an agent's) that differ for a percept, by the percept's name; "" for all."""
    context: tuple[float, ...] = ()
    """What the learner remembers beside the percept, as it is at the first step of an episode."""

    def __init__(self, options: Any, percept: Percept, rng: np.random.Generator): ...

    def values(self, state: PerceptState) -> list[float]:
        """Q(state, a) of the actions that the percept allows, in the order of `percept.actions`."""
        raise NotImplementedError

    def learn(self, transition: Transition) -> float:
        """Learn from one transition; return the temporal-difference error before the update."""
        raise NotImplementedError

    def save(self) -> dict[str, np.ndarray]:
        """Everything learned, as named arrays."""
        raise NotImplementedError

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        """Take over saved arrays; ValueError when they do not fit."""
        raise NotImplementedError

    def remember(self, state: Any, action: Any, gain: Any) -> tuple[Any, ...]:
        """The context that goes with the next percept.

        `action`, an index into `ACTIONS` (−1: none of the nine), was applied in `state` and made the
        brighter reading grow by `gain`. With arrays of shape (N,) instead of numbers it does the same for many robots.
        """
        return ()

    def batch_values(self, states: np.ndarray) -> np.ndarray:
        """`values` of many states, (N, variables) → (N, actions); override it where that can be quicker."""
        rows, which = np.unique(states, axis=0, return_inverse=True)
        return np.array([self.values(tuple(row)) for row in rows.tolist()])[which.reshape(-1)]


def discrete(percept: Percept) -> Percept:
    """The percept, if its states can be counted; for learners that keep a table.

    Raises
    ------
    UserError
        when they cannot.
    """
    if not all(percept.sizes):
        countable = ", ".join(name for name, one in PERCEPTS.items() if all(one.sizes))
        raise UserError(f"--percept {percept.name}: this learner keeps a table and needs countable states: {countable}")
    return percept


def annealed(first: float, last: float, progress: float) -> float:
    """A rate that falls geometrically from `first` to `last` while the budget is used up."""
    return first * (last / first) ** progress


def stored(arrays: dict[str, np.ndarray], name: str, like: np.ndarray) -> np.ndarray:
    """The array `name`, if it has the shape and type of `like`; ValueError when not."""
    array = arrays.get(name)
    if array is None or array.shape != like.shape or array.dtype != like.dtype:
        found = "none" if array is None else f"{array.shape} of {array.dtype}"
        raise ValueError(f"expected {name} {like.shape} of {like.dtype}, found {found}")
    return array


def stored_rows(arrays: dict[str, np.ndarray], name: str, width: int) -> np.ndarray:
    """The array `name`, if it has any number of rows of `width` float64 numbers; ValueError when not."""
    return stored(arrays, name, np.empty((len(arrays.get(name, ())), width)))


def available_learners() -> dict[str, EntryPoint]:
    """The learners that are installed, by name."""
    return {point.name: point for point in sorted(entry_points(group=LEARNER_GROUP))}


def find_learner(name: str) -> type[Learner]:
    """The learner class called `name`.

    Raises
    ------
    UserError
        when there is none (it lists those that exist), it cannot be loaded, or is not a learner.
    """
    points = available_learners()
    if name not in points:
        raise UserError(f"no learner '{name}'; {known(name, points)}")
    kind = load_point(points[name], f"the learner '{name}'")
    _check(kind, f"the learner '{name}' ({points[name].value})")
    return kind


def _check(kind: Any, what: str) -> None:
    """Raise UserError, with `what` as its subject, for an object that is not the class of a learner."""
    if not (isinstance(kind, type) and issubclass(kind, Learner)):
        raise UserError(f"{what} is not a subclass of phototaxis_agent.learner.Learner")
    options = getattr(kind, "Options", None)
    if not (isinstance(options, type) and issubclass(options, Struct)):
        raise UserError(f"{what} needs Options, a msgspec.Struct whose fields are its hyperparameters")
    for method in ("values", "learn", "save", "load"):
        if getattr(kind, method) is getattr(Learner, method):
            raise UserError(f"{what} has no method {method}")


def load_point(point: EntryPoint, what: str) -> Any:
    """What an entry point names; `what` says in errors what it is.

    Raises
    ------
    UserError
        when it cannot be imported, whatever the reason; it names the file and the line.
    """
    try:
        return point.load()
    except (Exception, SystemExit) as error:
        module = sys.modules.get(point.module) or PathFinder.find_spec(point.module)
        file = getattr(module, "__file__", None) or getattr(module, "origin", None)
        ours = isinstance(error, ModuleNotFoundError) and point.dist is not None and point.dist.name == "phototaxis"
        hint = f"; install it with: pip install {INSTALL_HINTS[point.group]}" if ours else ""
        raise UserError(f"{what} cannot be loaded from {point.value}: {told(error, file)}{hint}") from None
