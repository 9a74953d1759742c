"""Double Q-learning (van Hasselt 2010): two tables evaluate each other's best actions, so noise adds no value."""

from typing import Annotated

import numpy as np
from msgspec import Meta, Struct
from phototaxis.task import ACTIONS, Percept, PerceptState
from phototaxis_agent.learner import Learner, Transition, annealed, discrete, stored


class Hyperparameters(Struct, frozen=True, kw_only=True):
    """The hyperparameters of `DoubleQ`."""

    learning_rate: Annotated[float, Meta(gt=0, le=1)] = 0.16
    """learning rate at the first epoch; it falls geometrically to `learning_rate_end`"""
    learning_rate_end: Annotated[float, Meta(gt=0, le=1)] = 0.01
    """learning rate at the end of the budget"""
    gamma: Annotated[float, Meta(ge=0, lt=1)] = 0.75
    """discount factor"""


class DoubleQ(Learner):
    """A learner whose values are the mean of two tables; each learning step updates one of them, chosen at random."""

    Options = Hyperparameters

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self._options, self._rng = options, rng
        self._allowed = list(discrete(percept).actions)
        self._tables = np.zeros((2, *percept.sizes, len(ACTIONS)))

    def values(self, state: PerceptState) -> list[float]:
        return self._tables[(slice(None), *map(int, state))].mean(axis=0)[self._allowed].tolist()

    def learn(self, transition: Transition) -> float:
        chosen = int(self._rng.integers(2))
        here = (chosen, *map(int, transition.state), transition.action)
        following = self._tables[(slice(None), *map(int, transition.next_state))]
        best = max(self._allowed, key=lambda action: following[chosen, action])
        value = 0.0 if transition.terminated else self._options.gamma * following[1 - chosen, best]
        error = transition.reward + value - self._tables[here]
        self._tables[here] += (
            annealed(self._options.learning_rate, self._options.learning_rate_end, transition.progress) * error
        )
        return float(error)

    def save(self) -> dict[str, np.ndarray]:
        return {"tables": self._tables.copy()}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        self._tables[:] = stored(arrays, "tables", self._tables)


if __name__ == "__main__":
    raise SystemExit("this is a plug-in: pip install ./examples/double_q, then phototaxis train --learner double-q")
