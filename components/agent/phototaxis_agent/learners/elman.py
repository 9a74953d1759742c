"""A recurrent Elman net (section 8 of the paper; Elman 1990): the hidden units of the last step are inputs."""

from typing import Any

import numpy as np
from phototaxis.task import Percept

from phototaxis_agent.learners.ann import Ann
from phototaxis_agent.perceptron import Hyperparameters
from phototaxis_agent.threads import one_thread


class Elman(Ann):
    """As `Ann`, with context units: a copy of the hidden units as they were for the action last taken.

    As in Elman's paper the context is an input like any other: errors are not propagated back in time.
    """

    Options = Hyperparameters

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self.context = (0.5,) * options.hidden
        super().__init__(options, percept, rng)

    @one_thread
    def remember(self, state: Any, action: Any, gain: Any) -> tuple[Any, ...]:
        states = np.array(state, dtype=float).reshape(len(state), -1).T
        motors = self._motors[np.maximum(np.atleast_1d(action), 0)]  # none of the nine counts as standing still
        hidden = self._net.hidden(self._pairs(states, motors))[0].numpy()
        return tuple(hidden.T) if isinstance(action, np.ndarray) else tuple(hidden[0].tolist())
