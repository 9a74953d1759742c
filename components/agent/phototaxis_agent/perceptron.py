"""The paper's neural net (figure 8) in PyTorch: one hidden layer, back-propagation one example at a time.

The nets are so small that the overhead of each call dominates: autograd would take four times as long as the
gradient in closed form, which is four lines for one hidden layer.
"""

from typing import Annotated, Any

import numpy as np
import torch
from msgspec import Meta, Struct

from phototaxis_agent.learner import stored


class Hyperparameters(Struct, frozen=True, kw_only=True):
    """Hyperparameters of the neural nets."""

    target_rate: Annotated[float, Meta(gt=0, le=1)] = 1.0
    """α of equation 1: how far the target lies from the present Q towards r + γ max Q"""
    gamma: Annotated[float, Meta(ge=0, lt=1)] = 0.75
    """discount factor γ of equation 1"""
    learning_rate: Annotated[float, Meta(gt=0, le=10)] = 0.1
    """learning rate of back-propagation (conx: 0.1)"""
    momentum: Annotated[float, Meta(ge=0, lt=1)] = 0.9
    """share of the last weight change that is added to the next (conx: 0.9)"""
    hidden: Annotated[int, Meta(ge=1, le=1000)] = 4
    """hidden units"""
    initial_range: Annotated[float, Meta(gt=0, le=10)] = 0.1
    """initial weights and biases are uniform in ± this value (conx: 0.1)"""


PRESETS: dict[str, dict[str, Any]] = {
    "": {"gamma": 0.9, "temperature_start": 0.03, "temperature_end": 0.01, "learning_rate": 0.3},
    "rich": {
        "gamma": 0.3,
        "temperature_start": 0.1,
        "temperature_end": 0.02,
        "learning_rate": 0.1,
        "max_episode_steps": 300,
    },
}
"""Presets that were best for the paper's net; the other nets use the same, so that results are comparable."""


class Perceptron:
    """`nets` independent nets of `inputs`-hidden-1 units: sigmoid hidden units; sigmoid or linear output.

    Parameters
    ----------
    options : hidden units, learning rate, momentum and spread of the first weights.
    inputs, nets : numbers of inputs and of nets.
    linear : whether the output is linear instead of a sigmoid.
    rng : of the first weights.
    """

    def __init__(
        self, options: Hyperparameters, inputs: int, rng: np.random.Generator, *, nets: int = 1, linear: bool = False
    ):
        self._options, self._linear = options, linear
        self._shapes = (inputs, options.hidden), (1, options.hidden), (options.hidden, 1), (1, 1)
        size = sum(rows * columns for rows, columns in self._shapes)
        self._weights = torch.from_numpy(rng.uniform(-options.initial_range, options.initial_range, (nets, size)))
        self._changes = torch.zeros_like(self._weights)
        self._slopes = torch.zeros(size, dtype=torch.float64)
        self._first, self._bias, self._second, self._last = self._views(self._weights)

    def _views(self, flat: torch.Tensor) -> list[torch.Tensor]:
        """First layer, its bias, second layer, its bias, inside one tensor (…, size)."""
        parts = flat.split([rows * columns for rows, columns in self._shapes], dim=-1)
        return [part.view(*flat.shape[:-1], *shape) for part, shape in zip(parts, self._shapes, strict=True)]

    def hidden(self, inputs: torch.Tensor) -> torch.Tensor:
        """Activations of the hidden units: (nets, N, inputs) → (nets, N, hidden)."""
        return torch.sigmoid(torch.baddbmm(self._bias, inputs, self._first))

    def output(self, hidden: torch.Tensor) -> torch.Tensor:
        """(nets, N, hidden) → (nets, N)."""
        output = torch.baddbmm(self._last, hidden, self._second)[..., 0]
        return output if self._linear else torch.sigmoid(output)

    def learn(self, inputs: torch.Tensor, hidden: torch.Tensor, output: float, target: float, net: int = 0) -> None:
        """One step of back-propagation with momentum for one example.

        `inputs` (inputs,), what they made of the `hidden` units (hidden,), and the net's `output`.
        """
        delta = (target - output) * (1.0 if self._linear else output * (1 - output))
        first, bias, second, last = self._views(self._slopes)
        torch.mul(self._second[net, :, 0] * delta, hidden * (1 - hidden), out=bias[0])
        torch.outer(inputs, bias[0], out=first)
        torch.mul(hidden, delta, out=second[:, 0])
        last.fill_(delta)
        change = self._changes[net]
        change.mul_(self._options.momentum).add_(self._slopes, alpha=self._options.learning_rate)
        self._weights[net].add_(change)

    def save(self) -> dict[str, np.ndarray]:
        """Weights and their last changes, one row for each net."""
        return {"weights": self._weights.numpy().copy(), "changes": self._changes.numpy().copy()}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        """Take over what `save` gave; ValueError when it does not fit."""
        weights, changes = (stored(arrays, name, like) for name, like in self.save().items())
        self._weights.copy_(torch.from_numpy(weights))
        self._changes.copy_(torch.from_numpy(changes))
