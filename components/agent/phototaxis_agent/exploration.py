"""Boltzmann exploration with a decaying temperature (equation 2 and section 4.3 of the paper)."""

import math
from typing import Annotated

from msgspec import Meta, Struct


class Exploration(Struct, frozen=True, kw_only=True):
    """How random the choice of actions is, and how that falls during a run.

    The temperature falls geometrically from `temperature_start` to `temperature_end` over the share
    `exploration_fraction` of the budget and stays there.
    """

    temperature_start: Annotated[float, Meta(gt=0, le=100)] = 0.1
    """temperature T of equation 2 at the first epoch"""
    temperature_end: Annotated[float, Meta(gt=0, le=100)] = 0.05
    """temperature T at the end, and while a policy is evaluated"""
    exploration_fraction: Annotated[float, Meta(gt=0, le=1)] = 0.7
    """share of the epochs after which the temperature has reached `temperature_end`"""

    def temperature(self, epoch: int, budget: int) -> float:
        """T at an epoch of a budget of epochs."""
        progress = epoch / (self.exploration_fraction * budget) if budget else 1.0
        return (
            self.temperature_end
            if progress >= 1
            else self.temperature_start * (self.temperature_end / self.temperature_start) ** progress
        )


def draw(values: list[float], temperature: float, uniform: float) -> int:
    """Equation 2: the index of a value, drawn with probability ∝ exp(value / temperature).

    `uniform` is a random number in 0..1.
    """
    best = max(values)
    weights = [math.exp((value - best) / temperature) for value in values]
    threshold = uniform * sum(weights)
    for index, weight in enumerate(weights):
        threshold -= weight
        if threshold < 0:
            return index
    return len(weights) - 1
