"""A frozen policy for many robots at once: the same percepts, values and draws as `Agent`, in arrays."""

import numpy as np
from phototaxis.task import MOTORS, Episode

from phototaxis_agent.policy import Policy


class BatchAgent:
    """Drives N robots through one episode each, all of which begin at the same tick.

    Parameters
    ----------
    near : obstacle threshold of the arena, m.
    count : N.
    seed : of the draws.
    """

    def __init__(self, policy: Policy, near: float, count: int, seed: int):
        self._learner = policy.learner.seen_from(lambda: f"step {self._step} of an evaluation")
        self._percept, self._near, self._step = policy.percept, near, 0
        self._temperature = policy.exploration.temperature_end
        self._rng = np.random.default_rng(seed)
        self._context = np.tile(np.array(policy.learner.context, dtype=float), (count, 1))
        self._state = np.empty((count, 0))
        self._action = np.zeros(count, int)

    def __call__(self, episode: Episode) -> np.ndarray:
        """The motor commands (N, 2) of one tick."""
        history, count = episode.history, len(self._action)
        if self._step:
            remembered = self._learner.remember(tuple(self._state.T.copy()), self._action.copy(), history.gain)
            self._context = stack_columns(remembered, count)
        percept = stack_columns(self._percept.state(episode.now, history, self._near), count)
        self._state = np.concatenate([percept, self._context], axis=1)
        choice = draw_batch(self._learner.batch_values(self._state), self._temperature, self._rng.random(count))
        self._action = np.array(self._percept.actions)[choice]
        self._step += 1
        return MOTORS[self._action]


def stack_columns(values: tuple, count: int) -> np.ndarray:
    """One row for each robot from one array (or number) for each variable."""
    return np.stack([np.broadcast_to(value, count) for value in values], axis=1) if values else np.empty((count, 0))


def draw_batch(values: np.ndarray, temperature: float, uniform: np.ndarray) -> np.ndarray:
    """Equation 2 for each row of values (N, actions)."""
    weights = np.exp((values - values.max(axis=1, keepdims=True)) / temperature)
    threshold = uniform * weights.sum(axis=1)
    return np.minimum((weights.cumsum(axis=1) <= threshold[:, None]).sum(axis=1), values.shape[1] - 1)
