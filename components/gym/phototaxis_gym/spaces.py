"""What an environment's robot sees and does: the spaces, and how they come from readings, for one robot or many."""

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
"""How far a wheel command may lie outside of −1..1: what arithmetic in float32 makes of ±1. It is clipped."""


class Observer(Protocol):
    """Makes an environment's observation, (N, …) for N robots, of what robots observe and of the steps before."""

    @property
    def space(self) -> spaces.Space[Any]: ...

    def __call__(self, observation: Observation, history: LightHistory) -> Any: ...


class States:
    """The number of a percept's state: simple 0..23, rich 0..399, counted with the last variable fastest."""

    def __init__(self, percept: Percept, near: float):
        self._percept, self._near = percept, near
        self.space = spaces.Discrete(math.prod(percept.sizes))

    def __call__(self, observation: Observation, history: LightHistory) -> Any:
        return state_number(self._percept, self._percept.state(observation, history, self._near))


class Numbers:
    """The variables of a percept of real numbers, float32."""

    def __init__(self, percept: Percept, near: float):
        self._percept, self._near = percept, near
        self.space = spaces.Box(-1.0, 1.0, (len(percept.sizes),), np.float32)

    def __call__(self, observation: Observation, history: LightHistory) -> Any:
        return _rows(self._percept.state(observation, history, self._near))


class Sensors:
    """Everything as it is sensed: 2 lights (0..1), 16 sonars (m), front and rear bumper (0 or 1), float32."""

    def __init__(self, arena: Arena):
        high = [1.0] * 2 + [arena.robot.sonar_range] * 16 + [1.0] * 2
        self.space = spaces.Box(np.zeros(20, np.float32), np.array(high, np.float32))

    def __call__(self, observation: Observation, history: LightHistory) -> Any:
        return _rows((*observation.light, *observation.sonar, observation.front, observation.rear))


def _rows(variables: tuple[Any, ...]) -> np.ndarray:
    """(variables,) of numbers, or (N, variables) of arrays."""
    rows = np.empty((*max((np.shape(one) for one in variables), key=len), len(variables)), np.float32)
    for place, variable in enumerate(variables):
        rows[..., place] = variable
    return rows


def valid_percept(percept: str) -> str:
    """The name of an observation.

    Raises
    ------
    gymnasium.error.Error
        when there is none; it lists those that exist.
    """
    if percept not in PERCEPTS and percept != "sensors":
        raise Error(f"no percept '{percept}'; there are: {', '.join([*PERCEPTS, 'sensors'])}")
    return percept


def observer(percept: str, arena: Arena) -> Observer:
    """What makes the observation that `percept` names."""
    if percept == "sensors":
        return Sensors(arena)
    found, near = PERCEPTS[percept], arena.sensing.near
    return States(found, near) if all(found.sizes) else Numbers(found, near)


def rewards(reward: str, percept: str) -> Reward:
    """The reward scheme; "own" is the percept's, and `potential` for the bare sensors.

    Raises
    ------
    gymnasium.error.Error
        when there is none; it lists those that exist.
    """
    name = OWN_REWARD.get(percept, "potential") if reward == "own" else reward
    if name not in REWARDS:
        raise Error(f"no reward '{reward}'; there are: {', '.join(['own', *REWARDS])}")
    return REWARDS[name]


def actions(kind: str) -> spaces.Space[Any]:
    """Discrete: the nine of figure 5. Continuous: left and right wheel in −1..1.

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
    """The wheels' commands of one action, whatever number type it has.

    Raises
    ------
    WrongAction
        when it is not in the space.
    """
    if isinstance(space, spaces.Discrete):
        if space.contains(action):
            return ACTIONS[int(action)]
    elif (wheels := _numbers(action)).shape == (2,) and (np.abs(wheels) <= 1 + ROUNDING).all():
        left, right = np.clip(wheels, -1.0, 1.0).tolist()
        return left, right
    raise WrongAction(f"{action!r} is not in {space}")


def batch_motors(space: spaces.Space[Any], single: spaces.Space[Any], actions: Any, count: int) -> np.ndarray:
    """(count, 2): the wheels' commands of a batch of actions in `space`, each of them in `single`.

    Raises
    ------
    WrongAction
        when one is not in the space.
    WrongCount
        when they are not so many.
    TypeError
        as SyncVectorEnv does, for what is no batch.
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
    """An action as an array of floats; empty when it is nothing of the kind."""
    try:
        given = np.asarray(action)
    except ValueError:  # lists of different lengths
        return np.empty(0)
    return given.astype(float) if given.dtype.kind in "biuf" else np.empty(0)


def valid_steps(max_episode_steps: int) -> int:
    """The steps of an episode, at least one.

    Raises
    ------
    TypeError
        for what is no whole number.
    WrongSteps
        for fewer than one.
    """
    if not isinstance(max_episode_steps, int | np.integer):
        raise TypeError(f"max_episode_steps {max_episode_steps!r}: a whole number of steps is needed")
    if max_episode_steps < 1:
        raise WrongSteps(f"max_episode_steps {max_episode_steps}: an episode has at least one step")
    return max_episode_steps
