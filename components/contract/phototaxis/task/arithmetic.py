"""Operations that need different functions for one robot's numbers and for arrays with a number per robot.

A definition made of these, comparisons and `+ - * / & |` works for both, and gives bit-identical floats.
"""

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

Cases = Sequence[tuple[Any, Any]]
"""Pairs of a condition and a value."""


class Arithmetic(NamedTuple):
    """The operations, for one robot (`ONE`) or for an array of robots (`BATCH`)."""

    largest: Callable[..., Any]
    """The largest of its arguments."""
    smallest: Callable[..., Any]
    log: Callable[[Any], Any]
    first: Callable[[Cases, Any], Any]
    """The value of the first case whose condition holds; the second argument if none holds."""


def _first_of_one(cases: Cases, otherwise: Any) -> Any:
    for holds, value in cases:
        if holds:
            return value
    return otherwise


def _first_of_each(cases: Cases, otherwise: Any) -> Any:
    found: np.ndarray = np.asarray(otherwise)
    for holds, value in reversed(cases):
        found = np.where(holds, value, found)
    return found


def _largest_of_each(*values: Any) -> Any:
    return reduce(np.maximum, values)


def _smallest_of_each(*values: Any) -> Any:
    return reduce(np.minimum, values)


def _log_of_each(values: np.ndarray) -> np.ndarray:
    return np.array([math.log(value) for value in values.tolist()])  # np.log differs from math.log in the last bit


ONE = Arithmetic(max, min, math.log, _first_of_one)
BATCH = Arithmetic(_largest_of_each, _smallest_of_each, _log_of_each, _first_of_each)
