"""The light-seeking task of the paper: percepts, actions, rewards, and when the light is reached.

"Combining Q-Learning with Artificial Neural Networks in an Adaptive Light Seeking Robot"; each
definition names its section. Percepts and the memory are written so that the same expressions serve one
robot (numbers) and many at once (an array of shape (N,) wherever one robot has a number).
"""

import math
from collections import deque
from itertools import combinations
from typing import Annotated, Any, Literal, NamedTuple, Protocol

import numpy as np
from msgspec import Meta, Struct

REACHED = 0.95
"""A light reading above this counts as the light (section 4.4)."""

EQUAL = 0.01
"""Light readings this close count as equal (section 4.2)."""

STEPS = 5
"""How many consecutive steps must be equal to count as unchanged (section 4.2)."""

DARK = 0.005
"""Below this the logarithm of a light reading falls no more (reward scheme "potential")."""

ACTIONS: tuple[tuple[float, float], ...] = (
    (0.0, 0.0), (0.0, 1.0), (0.0, -1.0),
    (1.0, 0.0), (1.0, 1.0), (1.0, -1.0),
    (-1.0, 0.0), (-1.0, 1.0), (-1.0, -1.0),
)  # fmt: skip
"""The nine motor commands (left, right) of figure 5, in its order (which numbers the last one 9)."""

FORWARD = tuple(i for i, (left, right) in enumerate(ACTIONS) if left + right >= 0)
"""The actions without net backward motion, which the rich percept allows (section 4.2)."""

MOVING = tuple(i for i in FORWARD if any(ACTIONS[i]))
"""Those of them that move the robot, which the continuous percept allows."""

MIRRORED = tuple(ACTIONS.index((right, left)) for left, right in ACTIONS)
"""Each action seen in a mirror: left and right exchanged."""

FRONT, BACK, LEFT, RIGHT = (3, 4), (11, 12), (0, 15), (7, 8)
"""Sonar groups (figure 3), by index into `Readings.sonar`; a group reads its minimum."""

State = tuple[float, ...]


class Senses(Protocol):
    """What percepts read: `Readings`, or the same fields with an array wherever one robot has a number."""

    @property
    def sonar(self) -> Any:
        """16 ranges, m."""

    @property
    def light(self) -> Any:
        """Front left and front right, 0..1."""

    @property
    def front(self) -> Any:
        """Bumpers: contact during the last control period."""

    @property
    def rear(self) -> Any: ...


class CrowdReadings(NamedTuple):
    """What N robots sense at one tick; the fields of `Readings` that percepts read."""

    sonar: np.ndarray
    """(16, N) m."""
    light: np.ndarray
    """(2, N) 0..1: front left, front right."""
    front: np.ndarray
    """(N,) bool."""
    rear: np.ndarray


def lit(senses: Senses) -> bool:
    """Whether the light is reached: either sensor reads above 0.95 (section 4.4)."""
    left, right = senses.light
    return (left > REACHED) | (right > REACHED)


class Memory:
    """The light readings of the last steps of an episode."""

    def __init__(self) -> None:
        self.lights: deque[tuple[Any, Any]] = deque(maxlen=STEPS)

    def clear(self) -> None:
        """Begin a new episode."""
        self.lights.clear()

    def see(self, senses: Senses) -> None:
        """Remember the readings of one step."""
        self.lights.append(senses.light)

    @property
    def before(self) -> tuple[Any, Any]:
        """The readings of the step before; at the first step those of that step."""
        return self.lights[-2] if len(self.lights) > 1 else self.lights[-1]

    @property
    def unchanged(self) -> bool:
        """Whether the light has not changed in 5 consecutive steps (section 4.2, variable z).

        The last five readings of an episode lie within 0.01 of each other, on both sides.
        """
        if len(self.lights) < STEPS:
            return False
        same: Any = True
        for one, other in combinations(self.lights, 2):
            same = same & (abs(one[0] - other[0]) <= EQUAL) & (abs(one[1] - other[1]) <= EQUAL)
        return same


def _near(senses: Senses, group: tuple[int, int], threshold: float) -> Any:
    """1 where a sonar group reads below the threshold, else 0."""
    one, other = group
    return 1 * ((senses.sonar[one] < threshold) | (senses.sonar[other] < threshold))


class Percept(Protocol):
    """How readings become what the learner sees."""

    name: str
    variables: tuple[str, ...]
    sizes: tuple[int, ...]
    """Number of values of each variable; 0 for a real number in −1..1."""
    actions: tuple[int, ...]
    """The actions that may be taken, as indices into `ACTIONS`."""

    def state(self, senses: Senses, memory: Memory, near: float) -> State:
        """One value for each variable. `near` is the obstacle threshold in m; `memory` has seen `senses`."""
        ...

    def mirror(self, state: State) -> State:
        """The state that a mirror would show: left and right exchanged."""
        ...


class Simple:
    """The constrained representation (w, x, y, z) of section 4.2 and figure 4: 3·2·2·2 = 24 states.

    w: brighter side (0 left, 1 right, 2 equal within 0.01); x: obstacle in front; y: obstacle at the
    rear; z: light unchanged for 5 steps.
    """

    name = "simple"
    variables: tuple[str, ...] = ("w", "x", "y", "z")
    sizes: tuple[int, ...] = (3, 2, 2, 2)
    actions: tuple[int, ...] = tuple(range(len(ACTIONS)))

    def state(self, senses: Senses, memory: Memory, near: float) -> State:
        left, right = senses.light
        differ = 1 * (abs(left - right) > EQUAL)
        brighter = 2 - differ * (2 - (right > left))
        return brighter, _near(senses, FRONT, near), _near(senses, BACK, near), 1 * memory.unchanged

    def mirror(self, state: State) -> State:
        brighter, front, back, unchanged, *rest = state
        return (brighter if brighter == 2 else 1 - brighter), front, back, unchanged, *rest


class Rich:
    """The rich representation (u, v, w, x, y, z) of section 4.2: 5·5·2·2·2·2 = 400 states.

    u, v: left and right light in five bins of 0.2; w, x, y: obstacle in front, to the right, to the
    left; z: light unchanged for 5 steps. The robot may not move backwards.
    """

    name = "rich"
    variables: tuple[str, ...] = ("u", "v", "w", "x", "y", "z")
    sizes: tuple[int, ...] = (5, 5, 2, 2, 2, 2)
    actions: tuple[int, ...] = FORWARD

    def state(self, senses: Senses, memory: Memory, near: float) -> State:
        left, right = (sum(light * 5 >= edge for edge in (1, 2, 3, 4)) for light in senses.light)
        front, at_right, at_left = (_near(senses, group, near) for group in (FRONT, RIGHT, LEFT))
        return left, right, front, at_right, at_left, 1 * memory.unchanged

    def mirror(self, state: State) -> State:
        left, right, front, at_right, at_left, unchanged, *rest = state
        return right, left, front, at_left, at_right, unchanged, *rest


class Continuous:
    """Beyond the paper: twelve real numbers; the robot may neither move backwards nor stand still.

    The square root of each light (for the paper's light law 1 / distance); their contrast
    (left − right) / (left + right); the relative change of each since the last step; how near the front,
    back, left and right sonar groups are, from 0 at 1 m to 1 at 0 m; the two bumpers;
    and whether the light is unchanged for 5 steps.
    """

    name = "continuous"
    variables: tuple[str, ...] = (
        "left", "right", "contrast", "left change", "right change",
        "near front", "near back", "near left", "near right", "front bumper", "rear bumper", "unchanged",
    )  # fmt: skip
    sizes: tuple[int, ...] = (0,) * len(variables)
    actions: tuple[int, ...] = MOVING

    def state(self, senses: Senses, memory: Memory, near: float) -> State:
        (left, right), (left_before, right_before) = senses.light, memory.before
        near_front, near_back, near_left, near_right = (
            _nearness(senses.sonar[one], senses.sonar[other]) for one, other in (FRONT, BACK, LEFT, RIGHT)
        )
        return (
            left**0.5, right**0.5, _contrast(left, right), _contrast(left, left_before), _contrast(right, right_before),
            near_front, near_back, near_left, near_right, 1.0 * senses.front, 1.0 * senses.rear, 1.0 * memory.unchanged,
        )  # fmt: skip

    def mirror(self, state: State) -> State:
        left, right, contrast, left_change, right_change, front, back, at_left, at_right, *rest = state
        return right, left, -contrast, right_change, left_change, front, back, at_right, at_left, *rest


def _contrast(one: Any, other: Any) -> Any:
    """How much brighter one reading is than another, −1..1; readings below 0.001 count as dark."""
    return (one - other) / (one + other + 0.001)


def _nearness(one: Any, other: Any) -> Any:
    """0 where both ranges are 1 m or more, 1 where the smaller is 0."""
    closer = (one + other - abs(one - other)) / 2
    return 1 - (closer + 1 - abs(closer - 1)) / 2


PERCEPTS: dict[str, Percept] = {percept.name: percept for percept in (Simple(), Rich(), Continuous())}

Scheme = Literal["difference", "static", "potential"]


class Reward(Struct, frozen=True):
    """The reinforcement values of section 4.4, and one more scheme.

    In this order: `goal` at the light; `collision` in front or at the rear; `unchanged` while the light
    is unchanged for 5 steps; else by the brighter of the two readings:

    - "difference" (the simple percept's): its difference to the last step;
    - "static" (the rich one's): `approach` for any increase;
    - "potential" (not the paper's): the difference of its logarithm, a potential-based shaping (Ng, Harada
      and Russell 1999): a circle earns nothing, and a step towards the light earns alike near and far.
    """

    scheme: Scheme
    goal: float = 3.0
    collision: float = -2.0
    unchanged: float = -2.0
    approach: float = 2.0

    def __call__(self, brightest: float, now: Senses, unchanged: bool) -> float:
        """The reward of the step that led to `now`; `brightest` is the larger light reading before it."""
        if lit(now):
            return self.goal
        if now.front or now.rear:
            return self.collision
        if unchanged:
            return self.unchanged
        brighter = max(now.light)
        if self.scheme == "static":
            return self.approach if brighter > brightest else 0.0
        if self.scheme == "potential":
            return math.log(max(brighter, DARK) / max(brightest, DARK))
        return brighter - brightest

    def many(self, brightest: np.ndarray, now: Any, unchanged: np.ndarray) -> np.ndarray:
        """The same for N robots: all (N,), `now` readings of arrays."""
        brighter = np.maximum(*now.light)
        if self.scheme == "static":
            gain = np.where(brighter > brightest, self.approach, 0.0)
        elif self.scheme == "potential":
            gain = np.log(np.maximum(brighter, DARK) / np.maximum(brightest, DARK))
        else:
            gain = brighter - brightest
        cases = lit(now), now.front | now.rear, unchanged
        return np.select(cases, (self.goal, self.collision, self.unchanged), gain)


REWARDS: dict[str, Reward] = {
    "difference": Reward("difference"),
    "static": Reward("static"),
    "potential": Reward("potential", goal=3.0, collision=-1.0, unchanged=-0.5),
}

OWN_REWARD: dict[str, Scheme] = {"simple": "difference", "rich": "static", "continuous": "potential"}
"""The scheme that the paper gave each of its percepts."""


class TaskOptions(Struct, kw_only=True):
    """What is to be learned."""

    percept: Literal["simple", "rich", "continuous"] = "simple"
    """what the learner sees: 24 states, 400 states (both the paper's), or 12 real numbers"""
    reward: Literal["own", "difference", "static", "potential"] = "own"
    """reward scheme; own: the percept's (simple: difference, rich: static, continuous: potential)"""
    cap: Annotated[int, Meta(ge=1)] = 100
    """steps after which an episode is given up while learning"""

    def scheme(self) -> Reward:
        """The reward function."""
        return REWARDS[OWN_REWARD[self.percept] if self.reward == "own" else self.reward]
