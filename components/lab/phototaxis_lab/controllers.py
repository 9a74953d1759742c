"""Policies that learn nothing: the floor and the ceiling that learners are compared with."""

from collections.abc import Sequence

import numpy as np
from phototaxis.task import FRONT, LEFT, MOTORS, RIGHT, Episode

GAIN = 12.0
"""How strongly the Braitenberg controller turns for a contrast between its two sensors."""


class Random:
    """Any of some actions, all equally likely."""

    def __init__(self, actions: Sequence[int], seed: int):
        self._motors = MOTORS[list(actions)]
        self._rng = np.random.default_rng(seed)

    def __call__(self, episode: Episode) -> np.ndarray:
        return self._rng.choice(self._motors, len(episode.now.front))


class Braitenberg:
    """Each light sensor drives the opposite wheel (Braitenberg's vehicle 2b), with an escape from obstacles.

    It turns towards the brighter side the more the sides differ, spins where it is dark, and turns to the
    freer side where something is nearer than `near` in front.
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
