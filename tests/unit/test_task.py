"""The task is the paper's: percepts, actions, rewards, the history of unchanged light."""

import math
from itertools import product

import numpy as np
import pytest
from making import readings
from phototaxis.task import (
    ACTIONS,
    FORWARD,
    MOVING,
    PERCEPTS,
    REWARDS,
    Episode,
    LightHistory,
    TaskOptions,
    action_of,
    at_goal,
    state_number,
)
from phototaxis.wire.messages import Readings


def sonar(**near: float) -> list[float]:
    ranges = [5.0] * 16
    for group, value in near.items():
        ranges[{"front": 4, "back": 11, "left": 0, "right": 8}[group]] = value
    return ranges


def seen(percept: str, observation: Readings, times: int = 1) -> tuple[float, ...]:
    """The state after as many equal readings."""
    history = LightHistory()
    history.begin(observation.light)
    for _ in range(times - 1):
        history.step(observation.light)
    return PERCEPTS[percept].state(observation, history, 0.4)


def unchanged(history: LightHistory, light: tuple[float, float]) -> bool:
    history.step(light)
    return history.unchanged


def test_state_spaces_have_the_papers_sizes():
    assert math.prod(PERCEPTS["simple"].sizes) == 24
    assert math.prod(PERCEPTS["rich"].sizes) == 400
    assert len(ACTIONS) == len(set(ACTIONS)) == 9


def test_rich_never_moves_backwards():
    assert [ACTIONS[i] for i in FORWARD] == [(0, 0), (0, 1), (1, 0), (1, 1), (1, -1), (-1, 1)]
    assert PERCEPTS["rich"].actions == FORWARD
    assert len(PERCEPTS["simple"].actions) == 9


def test_continuous_neither_moves_backwards_nor_stands_still():
    assert [ACTIONS[i] for i in MOVING] == [(0, 1), (1, 0), (1, 1), (1, -1), (-1, 1)]
    assert PERCEPTS["continuous"].actions == MOVING


@pytest.mark.parametrize(
    ("light", "ranges", "unchanged", "state"),
    [
        ((0.3, 0.1), sonar(), False, (0, 0, 0, 0)),
        ((0.1, 0.3), sonar(front=0.3), False, (1, 1, 0, 0)),
        ((0.105, 0.1), sonar(back=0.39), True, (2, 0, 1, 1)),
        ((0.1, 0.3), sonar(front=0.41, left=0.1, right=0.1), False, (1, 0, 0, 0)),
    ],
)
def test_simple_percept(light, ranges, unchanged, state):
    assert seen("simple", readings(light=light, sonar=ranges), 5 if unchanged else 1) == state


@pytest.mark.parametrize(
    ("light", "ranges", "state"),
    [
        ((0.0, 0.19), sonar(), (0, 0, 0, 0, 0, 0)),
        ((0.2, 0.41), sonar(front=0.1), (1, 2, 1, 0, 0, 0)),
        ((0.79, 1.0), sonar(right=0.1), (3, 4, 0, 1, 0, 0)),
        ((0.81, 0.6), sonar(left=0.1, back=0.1), (4, 3, 0, 0, 1, 0)),
    ],
)
def test_rich_percept(light, ranges, state):
    assert seen("rich", readings(light=light, sonar=ranges)) == state


def test_unchanged_needs_five_equal_readings_on_both_sides():
    history = LightHistory()
    history.begin((0.1, 0.1))
    assert not history.unchanged
    assert [unchanged(history, (0.1, 0.1)) for _ in range(4)] == [False] * 3 + [True]
    assert unchanged(history, (0.109, 0.1))
    assert not unchanged(history, (0.109, 0.12))
    history.begin((0.109, 0.12))
    assert not history.unchanged


def test_light_is_reached_above_095_on_either_side():
    assert at_goal(readings(light=(0.1, 0.951)))
    assert not at_goal(readings(light=(0.95, 0.95)))


@pytest.mark.parametrize(
    ("scheme", "before", "now", "unchanged", "reward"),
    [
        ("difference", 0.1, {"light": (0.3, 0.2)}, False, 0.2),
        ("difference", 0.4, {"light": (0.3, 0.2)}, False, -0.1),
        ("difference", 0.1, {"light": (0.3, 0.2)}, True, -2),
        ("difference", 0.1, {"light": (0.3, 0.2), "rear": True}, False, -2),
        ("difference", 0.1, {"light": (0.96, 0.2), "front": True}, True, 3),
        ("static", 0.1, {"light": (0.11, 0.0)}, False, 2),
        ("static", 0.1, {"light": (0.1, 0.0)}, False, 0),
        ("static", 0.2, {"light": (0.1, 0.0)}, False, 0),
        ("static", 0.1, {"light": (0.2, 0.0), "front": True}, False, -2),
    ],
)
def test_rewards(scheme, before, now, unchanged, reward):
    episode, earlier = Episode(100), now["light"] if unchanged else (before, 0.0)
    episode.begin(readings(light=earlier))
    for light in [earlier] * 3 if unchanged else []:
        episode.step(readings(light=light))
    episode.step(readings(**now))
    assert TaskOptions(reward=scheme).scheme()(episode) == pytest.approx(reward)


def test_the_first_observation_of_an_episode_earns_nothing():
    episode = Episode(100)
    episode.begin(readings(light=(0.96, 0.2), front=True))
    assert {reward(episode) for reward in REWARDS.values()} == {0.0}


def test_commands_have_numbers_and_others_have_none():
    assert [action_of(*motors) for motors in ACTIONS] == list(range(9))
    assert action_of(0.3, 1.0) == -1


@pytest.mark.parametrize("name", ["simple", "rich"])
def test_states_are_numbered_with_the_last_variable_fastest(name):
    percept = PERCEPTS[name]
    states = list(product(*map(range, percept.sizes)))
    assert [state_number(percept, state) for state in states] == list(range(math.prod(percept.sizes)))
    assert state_number(percept, tuple(np.array(states).T)).tolist() == list(range(len(states)))


def test_each_percept_has_the_papers_reward():
    assert TaskOptions(percept="simple").scheme().scheme == "difference"
    assert TaskOptions(percept="rich").scheme().scheme == "static"
