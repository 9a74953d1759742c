"""Percepts: how an observation becomes the state that a learner sees."""

from typing import Any, Protocol

from phototaxis.task.actions import ACTIONS, FORWARD, MOVING
from phototaxis.task.history import EQUAL_LIGHT, LightHistory
from phototaxis.task.observation import BACK, FRONT, LEFT, RIGHT, Observation

PerceptState = tuple[float, ...]
"""One value for each variable of a percept."""


class Percept(Protocol):
    """Turns an observation into the state that the learner sees."""

    name: str
    variables: tuple[str, ...]
    sizes: tuple[int, ...]
    """Number of values of each variable; 0 for a real number in −1..1."""
    actions: tuple[int, ...]
    """The actions that the percept allows, as indices into `ACTIONS`."""

    def state(self, observation: Observation, history: LightHistory, near: float) -> PerceptState:
        """One value for each variable. `near` is the obstacle threshold in m; `history` ends with `observation`."""
        ...

    def mirror(self, state: PerceptState) -> PerceptState:
        """The mirror image of a state: left and right exchanged."""
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

    def state(self, observation: Observation, history: LightHistory, near: float) -> PerceptState:
        left, right = observation.light
        differ = 1 * (abs(left - right) > EQUAL_LIGHT)
        brighter = 2 - differ * (2 - (right > left))
        return brighter, _near(observation, FRONT, near), _near(observation, BACK, near), 1 * history.unchanged

    def mirror(self, state: PerceptState) -> PerceptState:
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

    def state(self, observation: Observation, history: LightHistory, near: float) -> PerceptState:
        left, right = (sum(light * 5 >= edge for edge in (1, 2, 3, 4)) for light in observation.light)
        front, at_right, at_left = (_near(observation, group, near) for group in (FRONT, RIGHT, LEFT))
        return left, right, front, at_right, at_left, 1 * history.unchanged

    def mirror(self, state: PerceptState) -> PerceptState:
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

    def state(self, observation: Observation, history: LightHistory, near: float) -> PerceptState:
        (left, right), (left_before, right_before) = observation.light, history.before
        near_front, near_back, near_left, near_right = (
            _nearness(observation.sonar[one], observation.sonar[other]) for one, other in (FRONT, BACK, LEFT, RIGHT)
        )
        return (
            left**0.5, right**0.5, _contrast(left, right), _contrast(left, left_before), _contrast(right, right_before),
            near_front, near_back, near_left, near_right,
            1.0 * observation.front, 1.0 * observation.rear, 1.0 * history.unchanged,
        )  # fmt: skip

    def mirror(self, state: PerceptState) -> PerceptState:
        left, right, contrast, left_change, right_change, front, back, at_left, at_right, *rest = state
        return right, left, -contrast, right_change, left_change, front, back, at_right, at_left, *rest


def _near(observation: Observation, group: tuple[int, int], threshold: float) -> Any:
    """1 where a sonar group reads below the threshold, else 0."""
    one, other = group
    return 1 * ((observation.sonar[one] < threshold) | (observation.sonar[other] < threshold))


def _contrast(one: Any, other: Any) -> Any:
    """How much brighter one reading is than another, −1..1; readings below 0.001 count as dark."""
    return (one - other) / (one + other + 0.001)


def _nearness(one: Any, other: Any) -> Any:
    """How near the smaller of two ranges is: 0 at 1 m or more, 1 at 0 m."""
    closer = (one + other - abs(one - other)) / 2
    return 1 - (closer + 1 - abs(closer - 1)) / 2


PERCEPTS: dict[str, Percept] = {percept.name: percept for percept in (Simple(), Rich(), Continuous())}


def state_number(percept: Percept, state: PerceptState) -> Any:
    """The number of a countable state, with the last variable changing fastest; an array for a state of arrays."""
    number: Any = 0
    for value, size in zip(state, percept.sizes, strict=True):
        number = number * size + value
    return number
