"""Policies that do not learn: a lower and an upper level to compare learners with."""

from collections.abc import Sequence

import numpy as np
from phototaxis.task import FRONT, LEFT, MOTORS, RIGHT, Episode

GAIN = 12.0
"""Turn of the Braitenberg controller for each unit of contrast between its two light sensors."""


class Random:
    """Draws one of some actions at random, all equally likely."""

    def __init__(self, actions: Sequence[int], seed: int):
        self._motors = MOTORS[list(actions)]
        self._rng = np.random.default_rng(seed)

    def __call__(self, episode: Episode) -> np.ndarray:
        return self._rng.choice(self._motors, len(episode.now.front))


class Braitenberg:
    """Drives each wheel by the light sensor of the opposite side (Braitenberg's vehicle 2b), and avoids obstacles.

    It turns towards the brighter side, faster when the sides differ more; it spins in the dark; and if something in
    front is nearer than `near` (m), it turns to the side with more room.
    """

    def __init__(self, near: float):
        self._near = near

    def __call__(self, episode: Episode) -> np.ndarray:
        observation = episode.now
        left, right = observation.light
        turn = GAIN * (left - right) / np.maximum(left + right, 1e-9)
        turn = np.where(left + right == 0, 2.0, turn)  # dark: spin
        front, at_left, at_right = (observation.sonar[list(group)].min(axis=0) for group in (FRONT, LEFT, RIGHT))
        turn = np.where(front < self._near, np.where(at_left > at_right, 2.0, -2.0), turn)
        return np.clip(np.stack([1 - turn, 1 + turn], axis=1), -1, 1)
