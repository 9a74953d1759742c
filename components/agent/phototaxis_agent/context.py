"""What a learner may remember beside the percept: the last action, and whether it got brighter."""

from typing import Any

from phototaxis.task import ACTIONS, MIRRORED, Percept, PerceptState

CONTEXT_SIZES = (len(ACTIONS) + 1, 3)
"""Number of values: the action + 1 (0 for none of the nine), and the trend (0 darker, 1 the same, 2 brighter)."""

INITIAL_CONTEXT = (0.0, 1.0)
"""At the first step of an episode."""


def remember(action: Any, gain: Any) -> tuple[Any, Any]:
    """The context after `action` (−1: none of the nine) made the brighter reading grow by `gain`."""
    return action + 1, 1 + 1 * (gain > 0) - 1 * (gain < 0)


def mirror(percept: Percept, state: PerceptState) -> PerceptState:
    """The mirror image of a state that ends with this context."""
    *seen, action, trend = state
    return *percept.mirror(tuple(seen)), (MIRRORED[int(action) - 1] + 1 if action else 0), trend
