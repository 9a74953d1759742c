"""The light-seeking task of the paper: percepts, actions, rewards, and when the light is reached.

"Combining Q-Learning with Artificial Neural Networks in an Adaptive Light Seeking Robot"; each
definition names its section. Everything here is a pure function of the `Readings` of an episode.
"""

from collections import deque
from typing import Annotated, Literal, Protocol

from msgspec import Meta, Struct

from phototaxis.messages import Readings

REACHED = 0.95
"""A light reading above this counts as the light (section 4.4)."""

EQUAL = 0.01
"""Light readings this close count as equal (section 4.2)."""

STEPS = 5
"""How many consecutive steps must be equal to count as unchanged (section 4.2)."""

ACTIONS: tuple[tuple[float, float], ...] = (
    (0.0, 0.0), (0.0, 1.0), (0.0, -1.0),
    (1.0, 0.0), (1.0, 1.0), (1.0, -1.0),
    (-1.0, 0.0), (-1.0, 1.0), (-1.0, -1.0),
)  # fmt: skip
"""The nine motor commands (left, right) of figure 5, in its order (which numbers the last one 9)."""

FORWARD = tuple(i for i, (left, right) in enumerate(ACTIONS) if left + right >= 0)
"""The actions without net backward motion, which the rich percept allows (section 4.2)."""

FRONT, BACK, LEFT, RIGHT = (3, 4), (11, 12), (0, 15), (7, 8)
"""Sonar groups (figure 3), by index into `Readings.sonar`; a group reads its minimum."""

State = tuple[int, ...]


def lit(readings: Readings) -> bool:
    """Whether the light is reached: either sensor reads above 0.95 (section 4.4)."""
    return max(readings.light) > REACHED


class Memory:
    """Whether the light readings have not changed in 5 consecutive steps (section 4.2, variable z).

    Unchanged: the last five readings of an episode lie within 0.01 of each other, on both sides.
    """

    def __init__(self) -> None:
        self.lights: deque[tuple[float, float]] = deque(maxlen=STEPS)

    def clear(self) -> None:
        """Begin a new episode."""
        self.lights.clear()

    def unchanged(self, readings: Readings) -> bool:
        """Remember the readings of one step, and say whether five are equal."""
        self.lights.append(readings.light)
        if len(self.lights) < STEPS:
            return False
        lefts, rights = zip(*self.lights, strict=True)
        return max(lefts) - min(lefts) <= EQUAL and max(rights) - min(rights) <= EQUAL


class Percept(Protocol):
    """How readings become a discrete state."""

    name: str
    sizes: tuple[int, ...]
    """Number of values of each variable; their product is the number of states."""
    variables: str
    actions: tuple[int, ...]
    """The actions that may be taken, as indices into `ACTIONS`."""

    def state(self, readings: Readings, unchanged: bool, near: float) -> State:
        """The state: one value for each variable. `near` is the obstacle threshold in metres."""
        ...


class Simple:
    """The constrained representation (w, x, y, z) of section 4.2 and figure 4: 3·2·2·2 = 24 states.

    w: brighter side (0 left, 1 right, 2 equal within 0.01); x: obstacle in front; y: obstacle at the
    rear; z: light unchanged for 5 steps.
    """

    name = "simple"
    sizes: tuple[int, ...] = (3, 2, 2, 2)
    variables = "wxyz"
    actions: tuple[int, ...] = tuple(range(len(ACTIONS)))

    def state(self, readings: Readings, unchanged: bool, near: float) -> State:
        left, right = readings.light
        sonar = readings.sonar
        brighter = 2 if abs(left - right) <= EQUAL else int(right > left)
        front = min(sonar[3], sonar[4]) < near
        back = min(sonar[11], sonar[12]) < near
        return brighter, int(front), int(back), int(unchanged)


class Rich:
    """The rich representation (u, v, w, x, y, z) of section 4.2: 5·5·2·2·2·2 = 400 states.

    u, v: left and right light in five bins of 0.2; w, x, y: obstacle in front, to the right, to the
    left; z: light unchanged for 5 steps. The robot may not move backwards.
    """

    name = "rich"
    sizes: tuple[int, ...] = (5, 5, 2, 2, 2, 2)
    variables = "uvwxyz"
    actions: tuple[int, ...] = FORWARD

    def state(self, readings: Readings, unchanged: bool, near: float) -> State:
        left, right = readings.light
        sonar = readings.sonar
        front = min(sonar[i] for i in FRONT) < near
        at_right = min(sonar[i] for i in RIGHT) < near
        at_left = min(sonar[i] for i in LEFT) < near
        bins = min(int(left * 5), 4), min(int(right * 5), 4)
        return *bins, int(front), int(at_right), int(at_left), int(unchanged)


PERCEPTS: dict[str, Percept] = {"simple": Simple(), "rich": Rich()}


class Reward(Struct, frozen=True):
    """The reinforcement values of section 4.4.

    In this order: +3 at the light; −2 for a collision in front or at the rear; −2 while the light is
    unchanged for 5 steps; else by the larger of the two readings, either its difference to the last
    step ("difference", the simple percept's) or `approach` for any increase ("static", the rich one's).
    """

    scheme: Literal["difference", "static"]
    goal: float = 3.0
    collision: float = -2.0
    unchanged: float = -2.0
    approach: float = 2.0

    def __call__(self, brightest: float, now: Readings, unchanged: bool) -> float:
        """The reward of the step that led to `now`; `brightest` is the larger light reading before it."""
        if lit(now):
            return self.goal
        if now.front or now.rear:
            return self.collision
        if unchanged:
            return self.unchanged
        gain = max(now.light) - brightest
        if self.scheme == "difference":
            return gain
        return self.approach if gain > 0 else 0.0


OWN_REWARD: dict[str, Literal["difference", "static"]] = {"simple": "difference", "rich": "static"}
"""The scheme that the paper gave each percept."""


class TaskOptions(Struct, kw_only=True):
    """What is to be learned."""

    percept: Literal["simple", "rich"] = "simple"
    """what the learner sees: 24 or 400 states"""
    reward: Literal["own", "difference", "static"] = "own"
    """reward scheme; own: the paper's for the percept (simple: difference, rich: static)"""
    cap: Annotated[int, Meta(ge=1)] = 100
    """steps after which an episode is given up while learning"""

    def scheme(self) -> Reward:
        """The reward function."""
        return Reward(OWN_REWARD[self.percept] if self.reward == "own" else self.reward)
