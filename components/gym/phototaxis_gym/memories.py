"""What N robots remember of the light."""

from collections import deque
from itertools import combinations

import numpy as np
from phototaxis.task import EQUAL, STEPS, CrowdReadings


class Memories:
    """`Memory` of N robots whose episodes begin at different times."""

    def __init__(self, count: int):
        self._lights: deque[np.ndarray] = deque(maxlen=STEPS)
        self._age = np.zeros(count, int)

    def forget(self, rows: np.ndarray) -> None:
        """Begin new episodes with the next readings."""
        self._age[rows] = 0

    def see(self, senses: CrowdReadings) -> None:
        """Remember the readings of one step."""
        self._lights.append(senses.light)
        self._age += 1

    def begin(self, senses: CrowdReadings, rows: np.ndarray) -> None:
        """Begin new episodes with these readings; for the other robots nothing has happened."""
        self._lights[-1] = np.where(rows, senses.light, self._lights[-1])
        self._age[rows] = 1

    @property
    def before(self) -> np.ndarray:
        """(2, N): the readings of the step before; at the first step those of that step."""
        now = self._lights[-1]
        return np.where(self._age > 1, self._lights[-2], now) if len(self._lights) > 1 else now

    @property
    def unchanged(self) -> np.ndarray:
        """(N,): whether the light has not changed in 5 consecutive steps of the episode."""
        same = self._age >= STEPS
        if not same.any():
            return same
        for one, other in combinations(self._lights, 2):
            same = same & (np.abs(one - other) <= EQUAL).all(axis=0)
        return same
