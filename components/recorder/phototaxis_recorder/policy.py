"""What was learned, drawn: for each state an arrow to where its best action drives the robot."""

import math

import numpy as np
import rerun as rr
from phototaxis.task import ACTIONS, Percept

from phototaxis_recorder.colors import BLUE, packed

UNVISITED, PRESENT = (190, 190, 190, 255), (255, 214, 130, 255)


def cells(sizes: tuple[int, ...]) -> np.ndarray:
    """Where the states stand in the picture, (states, 2): the first variables across, the others down."""
    states = math.prod(sizes)
    across = min(np.cumprod(sizes), key=lambda first: abs(math.log(first * first / states)))
    number = np.arange(states)
    return np.stack([number // (states // across), number % (states // across)], axis=1).astype(float)


def frame(percept: Percept) -> rr.LineStrips2D:
    """A border around all states."""
    (right, bottom), edge = cells(percept.sizes).max(axis=0), 0.6
    corners = [(-edge, -edge), (right + edge, -edge), (right + edge, bottom + edge), (-edge, bottom + edge)]
    return rr.LineStrips2D([[*corners, corners[0]]], colors=UNVISITED, radii=0.01)


def heading(action: int) -> tuple[float, float]:
    """A motor command as an arrow, y down: forward is up, a turn to the left points left; (0, 0) stands still."""
    left, right = ACTIONS[action]
    return 0.4 * (left - right) / 2, -0.4 * (left + right) / 2


HEADINGS = np.array([heading(action) for action in range(len(ACTIONS))])


def arrows(percept: Percept, table: np.ndarray, visits: np.ndarray) -> rr.Arrows2D:
    """The greedy action of every state; grey where the state was never met.

    Parameters
    ----------
    table : Q, shape (states, 9).
    visits : shape (states,).
    """
    allowed = np.array(percept.actions)
    best = allowed[np.argmax(table[:, allowed], axis=1)]
    met = np.where((visits > 0)[:, None], np.array((*BLUE, 255)), np.array(UNVISITED))
    vectors = HEADINGS[best]
    return rr.Arrows2D(vectors=vectors, origins=cells(percept.sizes) - vectors / 2, colors=packed(met), radii=0.05)


def present(percept: Percept, state: int) -> rr.Points2D:
    """The state in which the robot is."""
    return rr.Points2D(cells(percept.sizes)[state : state + 1], colors=PRESENT, radii=0.5, draw_order=-1)
