"""One definition of an episode for one robot and for arrays of robots, equal to the last bit."""

import math
from typing import Any

import numpy as np
import pytest
from making import readings
from phototaxis.task import REWARDS, BatchObservation, Episode
from phototaxis.wire.messages import ENDS

COUNT, TICKS, MAX_STEPS = 6, 60, 9


def observations(rng: np.random.Generator) -> list[BatchObservation]:
    """A random stream in which the light often stays as it was, is reached, and bumpers touch."""
    stream, light = [], rng.random((2, COUNT)) ** 2
    for _ in range(TICKS):
        moved = rng.random(COUNT) < 0.3
        light = np.where(moved, rng.random((2, COUNT)) ** 2, np.clip(light + rng.normal(0, 0.002, (2, COUNT)), 0, 1))
        stream.append(BatchObservation(np.full((16, COUNT), 5.0), light, *(rng.random((2, COUNT)) < 0.05)))
    return stream


def alone(observation: BatchObservation, row: int) -> Any:
    """What one of the robots observes, in plain numbers."""
    left, right = observation.light[:, row].tolist()
    return readings(light=(left, right), front=bool(observation.front[row]), rear=bool(observation.rear[row]))


def facts(episode: Episode) -> dict[str, Any]:
    """Everything that an episode says about itself."""
    history = episode.history
    said = {name: reward(episode) for name, reward in REWARDS.items()}
    said |= {name: getattr(episode, name) for name in ("steps", "terminated", "truncated", "end")}
    said |= {name: getattr(history, name) for name in ("gain", "unchanged")}
    said["left before"], said["right before"] = history.before
    return said


@pytest.mark.parametrize("seed", range(40))
def test_a_batch_of_episodes_is_so_many_single_ones_bit_for_bit(seed):
    rng = np.random.default_rng(seed)
    batch, singles = Episode(MAX_STEPS, COUNT), [Episode(MAX_STEPS) for _ in range(COUNT)]
    met = set()
    for tick, observation in enumerate(observations(rng)):
        begins = rng.random(COUNT) < 0.1 if tick else np.ones(COUNT, bool)
        batch.step(observation)
        batch.begin(observation, begins)
        for row, episode in enumerate(singles):
            (episode.begin if begins[row] else episode.step)(alone(observation, row))
        together = facts(batch)
        for row, episode in enumerate(singles):
            for name, value in facts(episode).items():
                column = together[name]
                assert column.shape == (COUNT,), name
                assert column[row].tobytes() == np.asarray(value, column.dtype).tobytes(), (tick, row, name)
            met.add((ENDS[episode.end], episode.history.unchanged))
    assert {("", False), ("", True), ("terminated", False), ("truncated", False)} <= met


def test_episodes_that_go_on_are_not_touched_by_those_that_begin():
    rng = np.random.default_rng(0)
    first, *rest = observations(rng)
    batch = Episode(MAX_STEPS, COUNT)
    batch.begin(first)
    batch.step(rest[0])
    before = facts(batch)
    half = np.arange(COUNT) % 2 == 0
    merged = BatchObservation(*(np.where(half, new, old) for new, old in zip(rest[1], rest[0], strict=True)))
    batch.begin(merged, half)
    for name, column in facts(batch).items():
        assert column[~half].tobytes() == before[name][~half].tobytes(), name
    assert not batch.steps[half].any()
    assert all(not reward(batch)[half].any() for reward in REWARDS.values())


def test_readings_begin_an_episode_unless_they_are_the_next_tick_of_the_present_one():
    episode, found = Episode(math.inf), []
    stream = [("r", 0, 0), ("r", 0, 1), ("r", 0, 2), ("r", 1, 3), ("r", 1, 4), ("r", 1, 6), ("s", 1, 7), ("s", 1, 7)]
    for run, number, tick in stream:
        episode.follow(readings(tick, run=run, episode=number))
        found.append(episode.steps)
    assert found == [0, 1, 2, 0, 1, 0, 0, 0]
    assert (episode.run, episode.number, episode.tick) == ("s", 1, 7)


@pytest.mark.parametrize("light", [(0.5, 0.96), (0.5, 0.5)])
def test_an_episode_terminates_at_the_light_and_is_truncated_after_its_steps(light):
    episode = Episode(3)
    episode.begin(readings(light=(0.1, 0.1)))
    ends = [ENDS[episode.end]]
    for _ in range(3):
        episode.step(readings(light=(0.5, 0.5)))
        ends.append(ENDS[episode.end])
    assert ends == ["", "", "", "truncated"]
    episode.step(readings(light=light))
    assert ENDS[episode.end] == ("terminated" if max(light) > 0.95 else "truncated"), "the light counts first"
