"""Confidence intervals of medians and means over seeds."""

from collections.abc import Sequence
from math import comb
from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.95
RESAMPLES = 10_000


class Interval(NamedTuple):
    """A 95% confidence interval."""

    low: float
    high: float


def median_interval(values: Sequence[float]) -> Interval:
    """Return the interval of the median from order statistics.

    They hold for any distribution, and outcomes over seeds are bimodal. The interval goes from the r-th lowest to the
    r-th highest value, with the largest rank r that covers at least 95%. With fewer than 6 values no rank does; then
    it goes from the lowest to the highest.
    """
    ordered, count = sorted(values), len(values)
    rank, missed = 1, 2 / 2**count
    while rank < (count + 1) // 2 and (missed := missed + 2 * comb(count, rank) / 2**count) <= 1 - CONFIDENCE:
        rank += 1
    return Interval(ordered[rank - 1], ordered[count - rank])


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the interval of the mean, by the percentile bootstrap."""
    return _percentiles(_means(values, np.random.default_rng(0)))


def difference_interval(ours: Sequence[float], theirs: Sequence[float]) -> Interval:
    """Return the interval of the difference of two independent means, by the percentile bootstrap."""
    rng = np.random.default_rng(0)
    return _percentiles(_means(ours, rng) - _means(theirs, rng))


def _means(values: Sequence[float], rng: np.random.Generator) -> np.ndarray:
    return rng.choice(np.asarray(values), (RESAMPLES, len(values))).mean(axis=1)


def _percentiles(means: np.ndarray) -> Interval:
    tail = 50 * (1 - CONFIDENCE)
    low, high = np.percentile(means, [tail, 100 - tail]).tolist()
    return Interval(low, high)
