"""Watkins's Q(λ): Q-learning with eligibility traces (Sutton and Barto, section 12.10)."""

from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta
from phototaxis.task import Percept

from phototaxis_agent.learner import Transition, annealed, stored_rows
from phototaxis_agent.learners import qtable

MIN_TRACE = 0.01
"""A trace that has decayed below this is dropped."""


class Hyperparameters(qtable.Hyperparameters, frozen=True, kw_only=True):
    """Hyperparameters of the table and its traces."""

    trace_decay: Annotated[float, Meta(ge=0, le=1)] = 0.8
    """trace decay λ: 0 is plain Q-learning; 1 corrects all earlier steps of the episode alike"""


class QLambda(qtable.QTable):
    """A table in which an error also corrects what led to it, the less the longer ago.

    Traces replace each other and are cut where an action was not the best one known.
    """

    Options = Hyperparameters
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "": {
            "reward": "potential", "learning_rate": 0.28, "learning_rate_end": 0.04, "gamma": 0.7,
            "temperature_start": 0.43, "temperature_end": 0.08, "exploration_fraction": 0.6,
        },
        "rich": {"temperature_end": 0.1},
    }  # fmt: skip

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        super().__init__(options, percept, rng)
        self._decay = options.trace_decay
        self._traces: dict[tuple[int, int], float] = {}

    def learn(self, transition: Transition) -> float:
        state, action, reward, next_state, terminated, progress, first = transition
        options, entry = self._options, (self._index[state], action)
        before = self._table[entry[0]][action]
        if first or before < max(self.values(state)):
            self._traces.clear()
        target = reward if terminated else reward + options.gamma * max(self.values(next_state))
        error = target - before
        self._traces[entry] = 1.0
        step = annealed(options.learning_rate, options.learning_rate_end, progress) * error
        fade = options.gamma * self._decay
        for (row, column), trace in self._traces.items():
            self._table[row][column] += step * trace
        self._traces = {entry: trace * fade for entry, trace in self._traces.items() if trace * fade > MIN_TRACE}
        return error

    def save(self) -> dict[str, np.ndarray]:
        rows = [(*entry, trace) for entry, trace in self._traces.items()]
        return {**super().save(), "traces": np.array(rows).reshape(-1, 3)}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        traces = stored_rows(arrays, "traces", 3)
        super().load(arrays)
        self._traces = {(int(row), int(column)): trace for row, column, trace in traces.tolist()}
