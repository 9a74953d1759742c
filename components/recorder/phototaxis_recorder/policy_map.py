"""What was learned, drawn: for each state an arrow to where its best action drives the robot."""

import math

import numpy as np
import rerun as rr
from phototaxis.task import ACTIONS, Percept

from phototaxis_recorder.colors import BLUE, packed

UNVISITED, PRESENT = (190, 190, 190, 255), (255, 214, 130, 255)
WIDTH, HEIGHT = 3.0, 2.0
"""The picture, whatever the number of states."""


def grid(sizes: tuple[int, ...]) -> tuple[int, int]:
    """Columns and rows for the states: the first variables across, the others down, in about the picture's shape."""
    states = math.prod(sizes)
    wanted = math.sqrt(states * WIDTH / HEIGHT)
    across = min(np.cumprod(sizes).tolist(), key=lambda first: abs(math.log(first / wanted)))
    return across, states // across


def cells(sizes: tuple[int, ...]) -> np.ndarray:
    """The middle of each state's cell, (states, 2)."""
    across, down = grid(sizes)
    number = np.arange(across * down)
    return np.stack([(number // down + 0.5) * WIDTH / across, (number % down + 0.5) * HEIGHT / down], axis=1)


def reach(sizes: tuple[int, ...]) -> float:
    """Half of what fits into a cell."""
    across, down = grid(sizes)
    return min(WIDTH / across, HEIGHT / down) / 2


def frame() -> rr.LineStrips2D:
    """A border around all states."""
    corners = [(0, 0), (WIDTH, 0), (WIDTH, HEIGHT), (0, HEIGHT), (0, 0)]
    return rr.LineStrips2D([corners], colors=UNVISITED, radii=0.005)


def heading(action: int) -> tuple[float, float]:
    """A motor command as an arrow, y down: forward is up, a turn to the left points left; (0, 0) stands still."""
    left, right = ACTIONS[action]
    return (left - right) / 2, -(left + right) / 2


HEADINGS = np.array([heading(action) for action in range(len(ACTIONS))])


def arrows(percept: Percept, table: np.ndarray, visits: np.ndarray) -> tuple[rr.Arrows2D, rr.Points2D]:
    """The greedy action of every state as an arrow, or as a dot where it is to stand still.

    Blue where the state was met; a small grey dot where it never was.

    Parameters
    ----------
    table : Q, shape (states, 9).
    visits : shape (states,).
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
    """The state in which the robot is."""
    place = cells(percept.sizes)[state : state + 1]
    return rr.Points2D(place, colors=PRESENT, radii=0.95 * reach(percept.sizes), draw_order=-1)
