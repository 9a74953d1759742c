"""The task is the paper's: percepts, actions, rewards, the memory of unchanged light."""

import math

import pytest
from making import readings
from phototaxis.messages import Readings
from phototaxis.task import ACTIONS, FORWARD, MOVING, PERCEPTS, Memory, TaskOptions, lit


def sonar(**near: float) -> list[float]:
    ranges = [5.0] * 16
    for group, value in near.items():
        ranges[{"front": 4, "back": 11, "left": 0, "right": 8}[group]] = value
    return ranges


def seen(percept: str, senses: Readings, times: int = 1) -> tuple[float, ...]:
    """The state after as many steps with the same readings."""
    memory = Memory()
    for _ in range(times):
        memory.see(senses)
    return PERCEPTS[percept].state(senses, memory, 0.4)


def unchanged(memory: Memory, light: tuple[float, float]) -> bool:
    memory.see(readings(light=light))
    return memory.unchanged


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
    memory = Memory()
    assert [unchanged(memory, (0.1, 0.1)) for _ in range(5)] == [False] * 4 + [True]
    assert unchanged(memory, (0.109, 0.1))
    assert not unchanged(memory, (0.109, 0.12))
    memory.clear()
    assert not unchanged(memory, (0.1, 0.1))


def test_light_is_reached_above_095_on_either_side():
    assert lit(readings(light=(0.1, 0.951)))
    assert not lit(readings(light=(0.95, 0.95)))


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
    found = TaskOptions(reward=scheme).scheme()(before, readings(**now), unchanged)
    assert found == pytest.approx(reward)


def test_each_percept_has_the_papers_reward():
    assert TaskOptions(percept="simple").scheme().scheme == "difference"
    assert TaskOptions(percept="rich").scheme().scheme == "static"
