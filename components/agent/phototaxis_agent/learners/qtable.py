"""Q-learning with a table (sections 2 and 5.1 of the paper)."""

from itertools import product
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct
from phototaxis.task import ACTIONS, Percept, PerceptState

from phototaxis_agent.learner import Learner, Transition, annealed, discrete, stored


class Hyperparameters(Struct, frozen=True, kw_only=True):
    """Hyperparameters of the table."""

    learning_rate: Annotated[float, Meta(gt=0, le=1)] = 0.16
    """learning rate α of equation 1 at the first epoch; it falls geometrically to `learning_rate_end`"""
    learning_rate_end: Annotated[float, Meta(gt=0, le=1)] = 0.01
    """learning rate at the end of the budget and after it"""
    gamma: Annotated[float, Meta(ge=0, lt=1)] = 0.75
    """discount factor γ of equation 1"""


class QTable(Learner):
    """One entry for each state and action: 24·9 = 216 (simple) or 400·9 = 3,600 (rich)."""

    Options = Hyperparameters

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self._options = options
        self._index: dict[PerceptState, int] = {
            state: i for i, state in enumerate(product(*map(range, discrete(percept).sizes)))
        }
        self._allowed = percept.actions
        shape = len(self._index), len(ACTIONS)
        self._table: list[list[float]] = rng.uniform(-0.15, 0.15, shape).tolist()  # section 5.1, step 1

    def values(self, state: PerceptState) -> list[float]:
        row = self._table[self._index[state]]
        return [row[action] for action in self._allowed]

    def learn(self, transition: Transition) -> float:
        """Equation 1: Q(s, a) += α [r + γ max Q(s', a') − Q(s, a)]; at the light nothing follows."""
        state, action, reward, next_state, terminated, progress, _ = transition
        options = self._options
        target = reward if terminated else reward + options.gamma * max(self.values(next_state))
        row = self._table[self._index[state]]
        error = target - row[action]
        row[action] += annealed(options.learning_rate, options.learning_rate_end, progress) * error
        return error

    def save(self) -> dict[str, np.ndarray]:
        return {"table": np.array(self._table)}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        self._table = stored(arrays, "table", self.save()["table"]).tolist()
