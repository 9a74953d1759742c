"""The light readings of an episode's last steps."""

from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np

from phototaxis.task.arithmetic import BATCH, ONE

EQUAL_LIGHT = 0.01
"""Light readings (0..1) this close count as equal (section 4.2)."""

UNCHANGED_STEPS = 5
"""The number of consecutive readings that must be equal to count as unchanged (section 4.2)."""


class LightHistory:
    """Keeps the recent light readings of an episode for percepts and rewards.

    Parameters
    ----------
    robots : N for N robots, whose episodes may begin at different times: a light reading is then (2, N) and each
        attribute (N,). None for one robot, with a pair of numbers and single numbers.

    Attributes
    ----------
    steps : steps since the episode began.
    lights : the last five light readings, the newest last; those before the episode repeat its first reading.
    """

    def __init__(self, robots: int | None = None):
        self.arithmetic = ONE if robots is None else BATCH
        dark: Any = (0.0, 0.0) if robots is None else np.zeros((2, robots))
        self.lights: deque[Any] = deque([dark] * UNCHANGED_STEPS, UNCHANGED_STEPS)
        self.steps: Any = 0 if robots is None else np.zeros(robots, int)
        self._unchanged: Any = None

    def begin(self, light: Any, which: Any = True) -> None:
        """Begin an episode with this reading; robots outside the mask `which` (N,) are unchanged."""
        first = self.arithmetic.first
        self.lights.extend([first([(which, light)], past) for past in self.lights])
        self.steps = first([(which, 0)], self.steps)
        self._unchanged = None

    def step(self, light: Any) -> None:
        """Add the reading of one more step."""
        self.lights.append(light)
        self.steps = self.steps + 1
        self._unchanged = None

    def restore(self, lights: Iterable[Any], steps: Any) -> None:
        """Continue from the `lights` and `steps` of another history."""
        self.lights.extend(lights)
        self.steps, self._unchanged = steps, None

    @property
    def before(self) -> Any:
        """The reading of the previous step; at an episode's first observation, that observation's own."""
        return self.lights[-2]

    @property
    def gain(self) -> Any:
        """How much the brighter reading grew in the last step."""
        largest = self.arithmetic.largest
        return largest(*self.lights[-1]) - largest(*self.lights[-2])

    @property
    def unchanged(self) -> Any:
        """Whether the light has not changed in 5 consecutive steps (section 4.2, variable z).

        The last five readings of the episode lie within 0.01 of each other, on both sides.
        """
        if self._unchanged is None:  # percepts and rewards both ask for it
            largest, smallest = self.arithmetic.largest, self.arithmetic.smallest
            left, right = zip(*self.lights, strict=True)
            self._unchanged = (
                (self.steps >= UNCHANGED_STEPS - 1)
                & (largest(*left) - smallest(*left) <= EQUAL_LIGHT)
                & (largest(*right) - smallest(*right) <= EQUAL_LIGHT)
            )
        return self._unchanged
