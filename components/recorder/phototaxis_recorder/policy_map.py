"""Draws the learned policy: for each percept state an arrow in the direction of the best action."""

import math

import numpy as np
import rerun as rr
from phototaxis.task import ACTIONS, Percept

from phototaxis_recorder.colors import BLUE, packed

UNVISITED, PRESENT = (190, 190, 190, 255), (255, 214, 130, 255)
WIDTH, HEIGHT = 3.0, 2.0
"""Size of the picture, for any number of states."""


def grid(sizes: tuple[int, ...]) -> tuple[int, int]:
    """Return columns and rows of the states, in about the picture's shape: the first variables span the columns."""
    states = math.prod(sizes)
    wanted = math.sqrt(states * WIDTH / HEIGHT)
    across = min(np.cumprod(sizes).tolist(), key=lambda first: abs(math.log(first / wanted)))
    return across, states // across


def cells(sizes: tuple[int, ...]) -> np.ndarray:
    """Return the middle of each state's cell, shape (states, 2)."""
    across, down = grid(sizes)
    number = np.arange(across * down)
    return np.stack([(number // down + 0.5) * WIDTH / across, (number % down + 0.5) * HEIGHT / down], axis=1)


def reach(sizes: tuple[int, ...]) -> float:
    """Return half the side of the largest square that fits into a cell."""
    across, down = grid(sizes)
    return min(WIDTH / across, HEIGHT / down) / 2


def frame() -> rr.LineStrips2D:
    """Return a border around all states."""
    corners = [(0, 0), (WIDTH, 0), (WIDTH, HEIGHT), (0, HEIGHT), (0, 0)]
    return rr.LineStrips2D([corners], colors=UNVISITED, radii=0.005)


def heading(action: int) -> tuple[float, float]:
    """Return an action as an arrow, y down: forward points up, a left turn points left, (0, 0) is standing still."""
    left, right = ACTIONS[action]
    return (left - right) / 2, -(left + right) / 2


HEADINGS = np.array([heading(action) for action in range(len(ACTIONS))])


def arrows(percept: Percept, table: np.ndarray, visits: np.ndarray) -> tuple[rr.Arrows2D, rr.Points2D]:
    """Return the greedy action of each visited state in blue: an arrow, or a dot for standing still.

    A state that was never visited gets a small grey dot.

    Parameters
    ----------
    table : Q values, shape (states, 9).
    visits : number of visits of each state, shape (states,).
    """
    allowed, met = np.array(percept.actions), visits > 0
    places, half = cells(percept.sizes), reach(percept.sizes)
    vectors = 1.4 * half * HEADINGS[allowed[np.argmax(table[:, allowed], axis=1)]]
    moving = met & vectors.any(axis=1)
    colors = packed(np.where(met[:, None], np.array((*BLUE, 255)), np.array(UNVISITED)))
    shown = vectors[moving]
    return (
        rr.Arrows2D(vectors=shown, origins=places[moving] - shown / 2, colors=colors[moving], radii=0.12 * half),
        rr.Points2D(places[~moving], colors=colors[~moving], radii=np.where(met, 0.3, 0.12)[~moving] * half),
    )


def present(percept: Percept, state: int) -> rr.Points2D:
    """Mark the state in which the robot is now."""
    place = cells(percept.sizes)[state : state + 1]
    return rr.Points2D(place, colors=PRESENT, radii=0.95 * reach(percept.sizes), draw_order=-1)
