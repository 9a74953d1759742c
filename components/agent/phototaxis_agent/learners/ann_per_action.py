"""One net for each action instead of one for all (section 8 of the paper)."""

from typing import Any, ClassVar

import numpy as np
import torch
from phototaxis.task import ACTIONS, Percept, PerceptState

from phototaxis_agent.inputs import Scaled
from phototaxis_agent.learner import Learner, Transition
from phototaxis_agent.learners.ann import REWARD_POINTS, TARGET_POINTS
from phototaxis_agent.perceptron import PRESETS, Hyperparameters, Perceptron
from phototaxis_agent.threads import one_thread


class AnnPerAction(Learner):
    """Nine nets, 4-4-1 (simple) or 6-4-1 (rich): only the net of the action taken learns."""

    Options = Hyperparameters
    presets: ClassVar[dict[str, dict[str, Any]]] = PRESETS

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self._options, self._scaled, self._allowed = options, Scaled(percept), list(percept.actions)
        self._net = Perceptron(options, self._scaled.width, rng, nets=len(ACTIONS))

    def _hidden(self, states: np.ndarray) -> torch.Tensor:
        """Hidden units of all nets, (actions, N, hidden)."""
        return self._net.hidden(torch.from_numpy(self._scaled(states)).expand(len(ACTIONS), -1, -1))

    @one_thread
    def batch_values(self, states: np.ndarray) -> np.ndarray:
        return self._net.output(self._hidden(states)).numpy()[self._allowed].T

    def values(self, state: PerceptState) -> list[float]:
        return self.batch_values(np.array([state], dtype=float))[0].tolist()

    @one_thread
    def learn(self, transition: Transition) -> float:
        """As `Ann`, with the net of the action."""
        state, action, reward, next_state, terminated, *_ = transition
        reward = float(np.interp(reward, REWARD_POINTS, TARGET_POINTS))
        both = np.array([state, next_state], dtype=float)
        hidden = self._hidden(both)
        values = self._net.output(hidden).numpy()
        before = float(values[action, 0])
        target = reward if terminated else reward + self._options.gamma * float(values[self._allowed, 1].max())
        error = target - before
        inputs = torch.from_numpy(self._scaled(both[0]))
        target = min(max(before + self._options.target_rate * error, 0.0), 1.0)
        self._net.learn(inputs, hidden[action, 0], before, target, action)
        return error

    def save(self) -> dict[str, np.ndarray]:
        return self._net.save()

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        self._net.load(arrays)
