"""What a robot observes at one tick, and whether it is at the light."""

from typing import Any, NamedTuple, Protocol

import numpy as np

GOAL_LIGHT = 0.95
"""A light reading (0..1) above this counts as the light (section 4.4)."""

FRONT, BACK, LEFT, RIGHT = (3, 4), (11, 12), (0, 15), (7, 8)
"""Sonar groups (figure 3), by index into `Observation.sonar`; a group reads its minimum."""


class Observation(Protocol):
    """What percepts read: the message `Readings`, or a `BatchObservation` with an array in place of each number."""

    @property
    def sonar(self) -> Any:
        """16 ranges, m."""

    @property
    def light(self) -> Any:
        """Front left and front right, 0..1."""

    @property
    def front(self) -> Any:
        """Whether the front bumper had contact during the last control period."""

    @property
    def rear(self) -> Any:
        """Whether the rear bumper had contact during the last control period."""


class BatchObservation(NamedTuple):
    """What N robots observe at one tick."""

    sonar: np.ndarray
    """(16, N) ranges, m."""
    light: np.ndarray
    """(2, N) front left and front right, 0..1."""
    front: np.ndarray
    """(N,) bool, contact of the front bumper."""
    rear: np.ndarray
    """(N,) bool, contact of the rear bumper."""


def at_goal(observation: Observation) -> Any:
    """Whether the light is reached: either sensor reads above 0.95 (section 4.4)."""
    left, right = observation.light
    return (left > GOAL_LIGHT) | (right > GOAL_LIGHT)
