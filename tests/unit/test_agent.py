"""The agent: equations 1 and 2, exactly-once learning, checkpoints that continue bit for bit."""

import math
from pathlib import Path

import numpy as np
import pytest
from making import readings
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import load, save
from phototaxis.runtime.errors import UserError
from phototaxis.task import PERCEPTS
from phototaxis.wire.messages import World
from phototaxis_agent.exploration import Exploration, draw
from phototaxis_agent.learner import Transition, find_learner
from phototaxis_agent.learners.qtable import Hyperparameters, QTable
from phototaxis_agent.setup import AgentSetup, from_checkpoint, make_setup
from phototaxis_lab.loop import Loop


@pytest.mark.parametrize(("percept", "entries"), [("simple", 216), ("rich", 3600)])
def test_tables_have_the_papers_sizes_and_start(percept, entries):
    table = QTable(Hyperparameters(), PERCEPTS[percept], np.random.default_rng(0)).save()["table"]
    assert table.size == entries
    assert -0.15 <= table.min() < -0.14
    assert 0.14 < table.max() <= 0.15


def test_equation_1():
    learner = QTable(
        Hyperparameters(learning_rate=0.5, learning_rate_end=0.1, gamma=0.9),
        PERCEPTS["simple"],
        np.random.default_rng(0),
    )
    state, next_state = (0, 0, 0, 0), (2, 1, 1, 1)
    table = np.zeros((24, 9))
    table[0, 3], table[23] = 1.0, [0, 0, 4, 0, 0, 0, 0, 0, 0]
    learner.load({"table": table})
    error = learner.learn(Transition(state, 3, 2.0, next_state, terminated=False, progress=0, first=True))
    assert error == pytest.approx(2 + 0.9 * 4 - 1)
    assert learner.values(state)[3] == pytest.approx(1 + 0.5 * error)
    learner.learn(Transition(state, 3, 3.0, next_state, terminated=True, progress=1, first=False))
    assert learner.values(state)[3] == pytest.approx((1 + 0.5 * error) * 0.9 + 0.3)


def test_equation_2():
    values, temperature = [0.1, 0.5, -0.2], 0.3
    draws = np.array([draw(values, temperature, u) for u in np.random.default_rng(0).random(30_000)])
    weights = np.exp(np.array(values) / temperature)
    assert np.bincount(draws) / len(draws) == pytest.approx(weights / weights.sum(), abs=0.01)
    assert draw([0.0, 1e6], 1e-3, 0.999) == 1


def test_temperature_falls_and_stays():
    exploration = Exploration(temperature_start=1.0, temperature_end=0.01, exploration_fraction=0.5)
    assert exploration.temperature(0, 1000) == 1
    assert exploration.temperature(250, 1000) == pytest.approx(0.1)
    assert exploration.temperature(500, 1000) == exploration.temperature(10_000, 1000) == 0.01


def test_the_agent_learns_from_the_action_that_was_applied(setup: AgentSetup, paper: Arena):
    agent = setup.agent(World(run="r", arena=paper, seed=0, epochs=0))
    agent(readings(0))
    before = agent.learner.save()["table"]
    agent(readings(1, left=1.0, right=-1.0, author="someone"))
    after = agent.learner.save()["table"]
    changed = np.argwhere(after != before)
    assert changed.tolist() == [[16, 5]]  # state (2, 0, 0, 0), action (fwd, rvs)
    agent(readings(2, left=0.3, right=0.1, author="someone"))  # none of the nine
    agent(readings(3, left=0.0, right=0.0, author=""))  # the motors were stopped
    agent(readings(4, episode=1, left=1.0, right=1.0, author="someone"))  # a new episode
    assert np.array_equal(agent.learner.save()["table"], after)
    assert agent.policy.epoch == 1


def test_episodes_end_at_the_light_and_after_their_last_step(paper: Arena):
    setup = make_setup(max_episode_steps=3)
    agent = setup.agent(World(run="r", arena=paper, seed=0, epochs=0))
    ends = [agent(readings(tick, left=1.0, right=1.0, author="a")).end for tick in range(5)]
    assert ends == ["", "", "", "truncated", "truncated"]
    assert agent(readings(9, episode=1, light=(0.2, 0.96))).end == "terminated"


def test_a_checkpoint_continues_bit_for_bit(tmp_path: Path, setup: AgentSetup, paper: Arena):
    whole = Loop(paper, setup.agent(World(run="r", arena=paper, seed=3, epochs=2000)), 3, 2000)
    for tick in range(1700):
        if tick == 1000:
            save(tmp_path / "c.npz", *whole.agent.checkpoint())
        whole.step()
    half = Loop(paper, whole.agent, 3, 2000)
    half.agent = setup.agent(World(run="r", arena=paper, seed=3, epochs=2000))
    half.agent.restore(*load(tmp_path / "c.npz"), source="c.npz")
    replay = Loop(paper, setup.agent(World(run="r", arena=paper, seed=3, epochs=2000)), 3, 2000)
    for tick in range(1700):
        if tick == 1000:
            replay.agent = half.agent
        replay.step()
    assert replay.simulation.state.hash == whole.simulation.state.hash
    assert replay.agent.checkpoint()[0] == whole.agent.checkpoint()[0]


@pytest.fixture
def file(tmp_path: Path, setup: AgentSetup, paper: Arena) -> Path:
    agent = setup.agent(World(run="r", arena=paper, seed=0, epochs=10))
    agent(readings(0))
    save(tmp_path / "c.npz", *agent.checkpoint())
    return tmp_path / "c.npz"


def test_a_checkpoint_of_another_percept_is_refused(file: Path, paper: Arena):
    rich = make_setup(percept="rich").agent(World(run="r", arena=paper, seed=0, epochs=10))
    with pytest.raises(UserError, match="of the percept 'simple', but 'rich' is asked for"):
        rich.restore(*load(file), source=str(file))


def test_bad_checkpoints_get_one_line(file: Path, tmp_path: Path):
    whole = file.read_bytes()
    flipped = bytearray(whole)
    flipped[whole.index(b"table.npy") + 200] ^= 1
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    np.savez(tmp_path / "pickled.npz", meta=np.array([{"a": 1}], dtype=object))
    bad = {
        "truncated": whole[: len(whole) // 2],
        "empty": b"",
        "not ours": b"hello, this is no checkpoint",
        "flipped": bytes(flipped),
        "other": (tmp_path / "other.npz").read_bytes(),
        "pickled": (tmp_path / "pickled.npz").read_bytes(),
    }
    for name, data in bad.items():
        path = tmp_path / f"{name}.npz"
        path.write_bytes(data)
        with pytest.raises(UserError, match=str(path)) as error:
            load(path)
        assert "\n" not in str(error.value), name
    with pytest.raises(UserError, match="no such checkpoint"):
        load(tmp_path / "missing.npz")


def test_a_checkpoint_knows_its_setup(file: Path):
    meta, _ = load(file)
    assert from_checkpoint(meta, "c") == make_setup()


def test_an_unknown_learner_lists_those_there_are():
    with pytest.raises(UserError, match=r"no learner 'magic'; there are: .*qtable"):
        find_learner("magic")


def test_a_frozen_agent_does_not_learn(setup: AgentSetup, paper: Arena):
    agent = setup.agent(World(run="r", arena=paper, seed=0, epochs=0), learning=False)
    before = agent.checkpoint()[0].learner_hash
    for tick in range(20):
        agent(readings(tick, left=1.0, right=1.0, author="a"))
    assert agent.checkpoint()[0].learner_hash == before
    assert math.isclose(agent.last.temperature, agent.policy.exploration.temperature_end)
