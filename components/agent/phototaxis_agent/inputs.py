"""Turns states into the inputs of a neural net."""

import numpy as np
import torch
from phototaxis.task import Percept


class Scaled:
    """Each variable as one number in 0..1 (section 5.2 of the paper).

    Counted variables are divided by their largest value; real ones are scaled by (x + 1) / 2.
    """

    def __init__(self, percept: Percept):
        sizes = np.array(percept.sizes)
        self._offset = np.where(sizes == 0, 1.0, 0.0)
        self._factor = np.where(sizes == 0, 0.5, 1 / np.maximum(sizes - 1, 1))
        self.width = len(sizes)

    def __call__(self, states: np.ndarray) -> np.ndarray:
        """(N, variables) → (N, width)."""
        return (states + self._offset) * self._factor


class OneHot:
    """Each counted variable as one input for each of its values, real ones as they are."""

    def __init__(self, sizes: tuple[int, ...]):
        self._variable = np.repeat(np.arange(len(sizes)), np.maximum(sizes, 1))
        self._value = np.concatenate([np.arange(max(size, 1)) for size in sizes])
        self._real = np.array(sizes)[self._variable] == 0
        self.width = len(self._variable)

    def __call__(self, states: np.ndarray) -> torch.Tensor:
        """(N, variables) → (N, width), float32."""
        spread = states[:, self._variable]
        return torch.from_numpy(np.where(self._real, spread, spread == self._value).astype(np.float32))
