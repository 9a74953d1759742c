"""The paper's neural net (section 5.2): 6-4-1 units for the simple percept, 8-4-1 for the rich one."""

from typing import Any, ClassVar

import numpy as np
import torch
from phototaxis.task import MOTORS, Percept, PerceptState

from phototaxis_agent.inputs import Scaled
from phototaxis_agent.learner import Learner, Transition
from phototaxis_agent.perceptron import PRESETS, Hyperparameters, Perceptron
from phototaxis_agent.threads import one_thread

REWARD_POINTS = (-2.0, 0.0, 2.0, 3.0)
TARGET_POINTS = (0.0, 0.5, 0.75, 1.0)
"""Targets to which the paper's rewards are mapped for a net with outputs in 0..1; linear in between."""


class Ann(Learner):
    """One net for all actions: state and motor command in, Q(state, action) out."""

    Options = Hyperparameters
    presets: ClassVar[dict[str, dict[str, Any]]] = PRESETS
    linear = False
    """Whether the output is linear; then rewards are not mapped."""

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self._options, self._percept, self._scaled = options, percept, Scaled(percept)
        motors = (MOTORS + 1) / 2
        self._motors, self._allowed = motors, motors[list(percept.actions)]
        width = self._scaled.width + len(self.context)
        self._net = Perceptron(options, width + 2, rng, linear=self.linear)

    def _pairs(self, states: np.ndarray, motors: np.ndarray) -> torch.Tensor:
        """The net's inputs for states (N, variables) and the motor command of each, (1, N, inputs)."""
        width = self._scaled.width
        return torch.from_numpy(np.concatenate([self._scaled(states[:, :width]), states[:, width:], motors], axis=1))[
            None
        ]

    @one_thread
    def batch_values(self, states: np.ndarray) -> np.ndarray:
        count, actions = len(states), len(self._allowed)
        pairs = self._pairs(np.repeat(states, actions, axis=0), np.tile(self._allowed, (count, 1)))
        return self._net.output(self._net.hidden(pairs)).numpy().reshape(count, actions)

    def values(self, state: PerceptState) -> list[float]:
        return self.batch_values(np.array([state], dtype=float))[0].tolist()

    @one_thread
    def learn(self, transition: Transition) -> float:
        """Equation 1 makes the target, back-propagation moves the net's output towards it."""
        state, action, reward, next_state, terminated, *_ = transition
        if not self.linear:
            reward = float(np.interp(reward, REWARD_POINTS, TARGET_POINTS))
        inputs = self._pairs(np.array([state], dtype=float), self._motors[action : action + 1])
        hidden = self._net.hidden(inputs)
        before = self._net.output(hidden).item()
        target = reward if terminated else reward + self._options.gamma * max(self.values(next_state))
        error = target - before
        target = before + self._options.target_rate * error
        self._net.learn(inputs[0, 0], hidden[0, 0], before, target if self.linear else min(max(target, 0.0), 1.0))
        return error

    def save(self) -> dict[str, np.ndarray]:
        return self._net.save()

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        self._net.load(arrays)
