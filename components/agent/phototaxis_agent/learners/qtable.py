"""Q-learning with a table (sections 2 and 5.1 of the paper)."""

from itertools import product
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct
from phototaxis.task import ACTIONS, Percept, State

from phototaxis_agent.learner import Transition


class Options(Struct, frozen=True, kw_only=True):
    """Hyperparameters of the table."""

    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.1
    """learning rate α of equation 1"""
    gamma: Annotated[float, Meta(ge=0, lt=1)] = 0.95
    """discount factor γ of equation 1"""


class QTable:
    """One entry for each state and action: 24·9 = 216 (simple) or 400·9 = 3,600 (rich)."""

    Options = Options

    def __init__(self, options: Options, percept: Percept, rng: np.random.Generator):
        self._alpha, self._gamma = options.alpha, options.gamma
        self._index = {state: i for i, state in enumerate(product(*map(range, percept.sizes)))}
        self._allowed = np.array(percept.actions)
        self.table = rng.uniform(-0.15, 0.15, (len(self._index), len(ACTIONS)))  # section 5.1, step 1

    def values(self, state: State) -> list[float]:
        return self.table[self._index[state], self._allowed].tolist()

    def learn(self, transition: Transition) -> float:
        """Equation 1: Q(s, a) += α [r + γ max Q(s', a') − Q(s, a)]; at the light nothing follows."""
        state, action, reward, following, terminated = transition
        target = reward if terminated else reward + self._gamma * max(self.values(following))
        at = self._index[state], action
        error = target - float(self.table[at])
        self.table[at] += self._alpha * error
        return error

    def save(self) -> dict[str, np.ndarray]:
        return {"table": self.table}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        table = arrays.get("table")
        if table is None or table.shape != self.table.shape or table.dtype != self.table.dtype:
            found = "none" if table is None else f"{table.shape} of {table.dtype}"
            raise ValueError(f"expected a table of {self.table.shape}, found {found}")
        self.table = table.copy()
