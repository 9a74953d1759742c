"""The spaces of an environment, and the conversions: sensors to observations, and actions to motor commands."""

import math
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from gymnasium.error import Error
from gymnasium.vector.utils import iterate
from phototaxis.geometry.arena import Arena
from phototaxis.task import (
    ACTIONS,
    MOTORS,
    OWN_REWARD,
    PERCEPTS,
    REWARDS,
    LightHistory,
    Observation,
    Percept,
    Reward,
    state_number,
)

from phototaxis_gym.errors import WrongAction, WrongCount, WrongSteps

ROUNDING = 1e-6
"""How far a wheel command may lie outside −1..1 because of rounding in float32; it is clipped."""


class Observer(Protocol):
    """Computes an environment's observation, shape (N, …) for N robots, from the sensors and the light history."""

    @property
    def space(self) -> spaces.Space[Any]: ...

    def __call__(self, observation: Observation, history: LightHistory) -> Any: ...


class States:
    """Observes the number of a percept's state: simple 0..23, rich 0..399; the last variable counts fastest."""

    def __init__(self, percept: Percept, near: float):
        self._percept, self._near = percept, near
        self.space = spaces.Discrete(math.prod(percept.sizes))

    def __call__(self, observation: Observation, history: LightHistory) -> Any:
        return state_number(self._percept, self._percept.state(observation, history, self._near))


class Numbers:
    """Observes the variables of a continuous percept, float32."""

    def __init__(self, percept: Percept, near: float):
        self._percept, self._near = percept, near
        self.space = spaces.Box(-1.0, 1.0, (len(percept.sizes),), np.float32)

    def __call__(self, observation: Observation, history: LightHistory) -> Any:
        return _rows(self._percept.state(observation, history, self._near))


class Sensors:
    """Observes all sensors: 2 lights (0..1), 16 sonars (m), front and rear bumper (0 or 1), float32."""

    def __init__(self, arena: Arena):
        high = [1.0] * 2 + [arena.robot.sonar_range] * 16 + [1.0] * 2
        self.space = spaces.Box(np.zeros(20, np.float32), np.array(high, np.float32))

    def __call__(self, observation: Observation, history: LightHistory) -> Any:
        return _rows((*observation.light, *observation.sonar, observation.front, observation.rear))


def _rows(variables: tuple[Any, ...]) -> np.ndarray:
    """Combine variables into one array: shape (variables,) if they are numbers, (N, variables) if they are arrays."""
    rows = np.empty((*max((np.shape(one) for one in variables), key=len), len(variables)), np.float32)
    for place, variable in enumerate(variables):
        rows[..., place] = variable
    return rows


def valid_percept(percept: str) -> str:
    """Return the name of an observation unchanged.

    Raises
    ------
    gymnasium.error.Error
        when there is no such observation; the text lists those that exist.
    """
    if percept not in PERCEPTS and percept != "sensors":
        raise Error(f"no percept '{percept}'; there are: {', '.join([*PERCEPTS, 'sensors'])}")
    return percept


def observer(percept: str, arena: Arena) -> Observer:
    """Return the observer of the observation that `percept` names."""
    if percept == "sensors":
        return Sensors(arena)
    found, near = PERCEPTS[percept], arena.sensing.near
    return States(found, near) if all(found.sizes) else Numbers(found, near)


def rewards(reward: str, percept: str) -> Reward:
    """Return a reward scheme; "own" is the percept's, or `potential` for "sensors".

    Raises
    ------
    gymnasium.error.Error
        when there is no such scheme; the text lists those that exist.
    """
    name = OWN_REWARD.get(percept, "potential") if reward == "own" else reward
    if name not in REWARDS:
        raise Error(f"no reward '{reward}'; there are: {', '.join(['own', *REWARDS])}")
    return REWARDS[name]


def actions(kind: str) -> spaces.Space[Any]:
    """Return the action space: "discrete" for the nine actions of figure 5, "continuous" for two wheels in −1..1.

    Raises
    ------
    gymnasium.error.Error
        for another kind.
    """
    if kind == "discrete":
        return spaces.Discrete(len(ACTIONS))
    if kind == "continuous":
        return spaces.Box(-1.0, 1.0, (2,), np.float32)
    raise Error(f"no actions '{kind}'; there are: discrete, continuous")


def motors(space: spaces.Space[Any], action: Any) -> tuple[float, float]:
    """Convert one action, with numbers of any type, to the commands of the two wheels.

    Raises
    ------
    WrongAction
        when the action is not in the space.
    """
    if isinstance(space, spaces.Discrete):
        if space.contains(action):
            return ACTIONS[int(action)]
    elif (wheels := _numbers(action)).shape == (2,) and (np.abs(wheels) <= 1 + ROUNDING).all():
        left, right = np.clip(wheels, -1.0, 1.0).tolist()
        return left, right
    raise WrongAction(f"{action!r} is not in {space}")


def batch_motors(space: spaces.Space[Any], single: spaces.Space[Any], actions: Any, count: int) -> np.ndarray:
    """Convert a batch of actions to wheel commands, shape (count, 2); `single` is the space of one action.

    Raises
    ------
    WrongAction
        when an action is not in the space.
    WrongCount
        when the number of actions is not `count`.
    TypeError
        as SyncVectorEnv does, when `actions` is not a batch.
    """
    given: np.ndarray = actions if isinstance(actions, np.ndarray) else np.empty(0)
    if isinstance(single, spaces.Discrete):
        if given.shape == (count,) and given.dtype.kind in "iu" and ((given >= 0) & (given < len(MOTORS))).all():
            return MOTORS[given]
    elif given.shape == (count, 2) and given.dtype.kind in "fiu" and (np.abs(given) <= 1).all():
        return given.astype(float)
    rows = list(iterate(space, actions))
    if len(rows) != count:
        raise WrongCount(f"{len(rows)} actions for {count} robots")
    return np.array([motors(single, row) for row in rows])


def _numbers(action: Any) -> np.ndarray:
    """Convert an action to an array of floats; the array is empty when that is impossible."""
    try:
        given = np.asarray(action)
    except ValueError:  # lists of different lengths
        return np.empty(0)
    return given.astype(float) if given.dtype.kind in "biuf" else np.empty(0)


def valid_steps(max_episode_steps: int) -> int:
    """Return the step cap unchanged.

    Raises
    ------
    TypeError
        when it is not a whole number.
    WrongSteps
        when it is below 1.
    """
    if not isinstance(max_episode_steps, int | np.integer):
        raise TypeError(f"max_episode_steps {max_episode_steps!r}: it must be a whole number")
    if max_episode_steps < 1:
        raise WrongSteps(f"max_episode_steps {max_episode_steps}: an episode has at least one step")
    return max_episode_steps
