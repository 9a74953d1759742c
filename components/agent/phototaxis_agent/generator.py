"""Saves the state of a random generator as JSON; its integers exceed 64 bits, so they are stored as text."""

from typing import Any

import numpy as np


def saved_state(rng: np.random.Generator) -> dict[str, Any]:
    """The generator's state, with its numbers as text."""
    return _map(str, rng.bit_generator.state)


def load_state(rng: np.random.Generator, state: dict[str, Any]) -> None:
    """Put a generator into a saved state.

    Raises
    ------
    KeyError, TypeError, ValueError
        when the state is of another generator.
    """
    rng.bit_generator.state = _map(_number, state)


def _map(change: Any, value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _map(change, item) for key, item in value.items()}
    return change(value) if isinstance(value, (int, str)) and not isinstance(value, bool) else value


def _number(text: Any) -> Any:
    return int(text) if isinstance(text, str) and text.lstrip("-").isdigit() else text
