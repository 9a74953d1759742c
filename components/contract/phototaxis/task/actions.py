"""The nine motor commands that a learner chooses from."""

import numpy as np

ACTIONS: tuple[tuple[float, float], ...] = (
    (0.0, 0.0), (0.0, 1.0), (0.0, -1.0),
    (1.0, 0.0), (1.0, 1.0), (1.0, -1.0),
    (-1.0, 0.0), (-1.0, 1.0), (-1.0, -1.0),
)  # fmt: skip
"""The motor commands (left, right) of figure 5, in the order of the figure, which counts them from 1."""

MOTORS = np.array(ACTIONS)
"""`ACTIONS` as an array (9, 2)."""

FORWARD = tuple(i for i, (left, right) in enumerate(ACTIONS) if left + right >= 0)
"""The actions without net backward motion, which the rich percept allows (section 4.2)."""

MOVING = tuple(i for i in FORWARD if any(ACTIONS[i]))
"""The actions of `FORWARD` that move the robot, which the continuous percept allows."""

MIRRORED = tuple(ACTIONS.index((right, left)) for left, right in ACTIONS)
"""Each action seen in a mirror: left and right exchanged."""

_INDEX = {motors: index for index, motors in enumerate(ACTIONS)}


def action_of(left: float, right: float) -> int:
    """The index of a motor command in `ACTIONS`; −1 for a command that is none of the nine."""
    return _INDEX.get((left, right), -1)
