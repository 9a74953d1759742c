"""Every learner: complete checkpoints, one answer for one and for many; and each one's own mathematics."""

import numpy as np
import pytest
import torch
from making import own_learners
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import learner_hash, load, save
from phototaxis.runtime.errors import UserError
from phototaxis.task import ACTIONS, MIRRORED, PERCEPTS
from phototaxis.wire.messages import World
from phototaxis_agent import context
from phototaxis_agent.inputs import OneHot, Scaled
from phototaxis_agent.learner import Learner, Transition, find_learner
from phototaxis_agent.perceptron import Hyperparameters, Perceptron
from phototaxis_agent.setup import make_setup
from phototaxis_lab.loop import Loop

TABLES = ["qtable", "qlambda", "mirror"]
NETS = ["ann", "ann-linear", "ann-per-action", "elman", "dqn"]
EVERY = [(name, percept) for name in TABLES + NETS for percept in PERCEPTS if name in NETS or percept != "continuous"]


def make(name: str, percept: str, **options) -> Learner:
    setup = make_setup(name, percept=percept, **options)
    return find_learner(name)(setup.hyperparameters, PERCEPTS[percept], np.random.default_rng(0))


def test_these_are_the_names():
    assert set(own_learners()) == set(TABLES + NETS)


@pytest.mark.parametrize(("name", "percept"), EVERY)
def test_a_checkpoint_continues_bit_for_bit(tmp_path, paper: Arena, name, percept):
    setup, epochs, half = make_setup(name, percept=percept, max_episode_steps=40), 360, 200
    whole = Loop(paper, setup.agent(World(run="r", arena=paper, seed=3, epochs=epochs)), 3, epochs)
    other = Loop(paper, setup.agent(World(run="r", arena=paper, seed=3, epochs=epochs)), 3, epochs)
    for tick in range(epochs):
        if tick == half:
            save(tmp_path / "c.npz", *whole.agent.checkpoint())
            other.agent = setup.agent(World(run="r", arena=paper, seed=3, epochs=epochs))
            other.agent.restore(*load(tmp_path / "c.npz"), source="c.npz")
        whole.step()
        other.step()
    assert other.simulation.state.hash == whole.simulation.state.hash
    assert other.agent.checkpoint()[0] == whole.agent.checkpoint()[0]


@pytest.mark.parametrize(("name", "percept"), EVERY)
def test_values_of_many_are_values_of_each(paper: Arena, name, percept):
    agent = make_setup(name, percept=percept).agent(World(run="r", arena=paper, seed=3, epochs=300))
    loop, states, actions = Loop(paper, agent, 3, 300), [], []
    for _ in range(60):
        loop.step()
        states.append(agent._state)
        actions.append(max(agent.last.action, 0))
    learner = agent.learner
    found = learner.batch_values(np.array(states, dtype=float))
    assert found.shape == (60, len(PERCEPTS[percept].actions))
    assert found == pytest.approx(np.array([learner.values(state) for state in states]), abs=1e-6)
    gains = np.linspace(-1, 1, 60)
    many = learner.remember(tuple(np.array(states, dtype=float).T), np.array(actions), gains)
    one_by_one = zip(*[learner.remember(*one) for one in zip(states, actions, gains, strict=True)], strict=True)
    assert [column.tolist() for column in many] == [pytest.approx(list(column)) for column in one_by_one]


@pytest.mark.parametrize(("name", "percept"), EVERY)
def test_foreign_arrays_are_refused(name, percept):
    learner = make(name, percept)
    kept = learner_hash(learner.save())
    for arrays in ({}, {key: array[..., None] for key, array in learner.save().items()}):
        with pytest.raises(ValueError, match="expected"):
            learner.load(arrays)
    assert learner_hash(learner.save()) == kept


@pytest.mark.parametrize("name", TABLES)
def test_a_table_needs_states_that_can_be_counted(name):
    with pytest.raises(UserError, match=r"--percept continuous: .*needs countable states: simple, rich"):
        make(name, "continuous")


def step(state, action, reward, next_state, terminated=False, first=False) -> Transition:
    return Transition(state, action, reward, next_state, terminated, 0.0, first)


A, B, C = (0, 0, 0, 0), (2, 0, 0, 0), (2, 1, 0, 0)


def test_qlambda_corrects_what_led_to_an_error():
    learner = make("qlambda", "simple", learning_rate=0.5, gamma=0.8, trace_decay=0.5)
    learner.load({"table": np.zeros((24, 9)), "traces": np.empty((0, 3))})
    learner.learn(step(A, 3, 0.0, B, first=True))
    learner.learn(step(B, 4, 1.0, C))
    assert learner.values(B)[4] == pytest.approx(0.5)
    assert learner.values(A)[3] == pytest.approx(0.5 * 0.8 * 0.5)
    learner.learn(step(C, 0, 1.0, A, first=True))  # elsewhere: nothing led there
    assert learner.values(A)[3] == pytest.approx(0.2)
    learner.learn(step(A, 0, 1.0, B))  # not the best action known in A: traces are cut
    assert learner.values(C)[0] == pytest.approx(0.5 * (1 + 0.8 * 0.2))


def folded(**options) -> Learner:
    return make("mirror", "simple", gamma=0.8, initial_value=0.0, ridge=1e-6, context="none", **options)


def test_mirror_shares_entries_with_the_mirror_image():
    learner = folded()
    learner.learn(step(A, 3, 1.0, B, terminated=True, first=True))
    assert learner.values(A)[3] == pytest.approx(1)
    assert learner.values((1, 0, 0, 0))[MIRRORED[3]] == pytest.approx(1)
    assert sum(map(sum, map(learner.values, np.ndindex(3, 2, 2, 2)))) == pytest.approx(2)


def test_mirror_learns_from_the_action_that_followed():
    learner = folded(trace_decay=0.0)
    for reward in (2.0, 3.0, 4.0):
        learner.learn(step(B, 4, reward, C, terminated=True, first=True))
    assert learner.values(B)[4] == pytest.approx(3)  # the mean of all, without a learning rate
    learner.learn(step(A, 3, 1.0, B, first=True))
    assert learner.values(A)[3] == 0
    learner.learn(step(B, 8, 0.0, C))
    assert learner.values(A)[3] == pytest.approx(1 + 0.8 * 0, abs=1e-4)
    learner.learn(step(A, 5, 1.0, B, first=True))
    learner.learn(step(B, 4, 3.0, C, terminated=True))
    assert learner.values(A)[5] == pytest.approx(1 + 0.8 * 3, abs=1e-4)


@pytest.mark.parametrize("trace_decay", [0.0, 0.7])
def test_mirror_solves_the_least_squares_of_all_it_met(trace_decay):
    rng, learner = np.random.default_rng(0), folded(trace_decay=trace_decay)
    names, matrix, right, trace = {}, np.eye(20) * 1e-6, np.zeros(20), np.zeros(20)
    states = [(2, 0, 0, 0), (2, 1, 0, 0), (2, 0, 1, 0)]  # their own mirror images
    actions = [0, 4, 8]
    walk = [(states[rng.integers(3)], actions[rng.integers(3)]) for _ in range(60)]
    rewards = rng.normal(size=60)
    for number, (now, next_state) in enumerate(zip(walk, walk[1:] + walk[:1], strict=True)):
        last = number == 59
        learner.learn(Transition(*now, rewards[number], next_state[0], last, 0.0, number == 0))
        one, other = (names.setdefault(key, len(names)) for key in (now, next_state))
        trace *= 0.8 * trace_decay
        trace[one] += 1
        slope = np.eye(20)[one] - (0 if last else 0.8) * np.eye(20)[other]
        matrix += np.outer(trace, slope)
        right += trace * rewards[number]
    solved = np.linalg.solve(matrix, right)
    for (state, action), index in names.items():
        assert learner.values(state)[action] == pytest.approx(solved[index], abs=0.02)


@pytest.mark.parametrize("percept", PERCEPTS.values(), ids=str)
def test_a_mirror_of_a_mirror_is_the_world(percept):
    rng = np.random.default_rng(0)
    for _ in range(100):
        state = tuple(int(rng.integers(size)) if size else float(rng.uniform(-1, 1)) for size in percept.sizes)
        whole = (*state, float(rng.integers(10)), float(rng.integers(3)))
        assert context.mirror(percept, context.mirror(percept, whole)) == whole
    assert [ACTIONS[MIRRORED[action]] for action in range(9)] == [(right, left) for left, right in ACTIONS]


@pytest.mark.parametrize("linear", [False, True])
def test_back_propagation_is_the_gradient(linear):
    options = Hyperparameters(learning_rate=0.1, momentum=0.5, initial_range=1.0)
    net = Perceptron(options, 6, np.random.default_rng(0), nets=2, linear=linear)
    inputs, target = torch.linspace(0, 1, 6, dtype=torch.float64), 0.3
    for _ in range(2):
        before = net.save()
        hidden = net.hidden(inputs[None].expand(2, 1, 6))
        output = net.output(hidden)
        weights = torch.from_numpy(before["weights"]).requires_grad_()
        first, bias, second, last = net._views(weights)
        by_hand = torch.sigmoid(inputs @ first[1] + bias[1, 0]) @ second[1, :, 0] + last[1, 0, 0]
        by_hand = by_hand if linear else torch.sigmoid(by_hand)
        assert output[1, 0].item() == pytest.approx(by_hand.item())
        (0.5 * (target - by_hand) ** 2).backward()
        net.learn(inputs, hidden[1, 0], output[1, 0].item(), target, net=1)
        slope = weights.grad
        assert slope is not None
        change = 0.5 * before["changes"] - 0.1 * slope.numpy()
        assert net.save()["weights"] == pytest.approx(before["weights"] + change)
        assert np.array_equal(net.save()["weights"][0], before["weights"][0])


@pytest.mark.parametrize(("percept", "weights"), [("simple", 6 * 4 + 4 + 4 + 1), ("rich", 8 * 4 + 4 + 4 + 1)])
def test_the_net_has_the_papers_shape(percept, weights):
    saved = make("ann", percept).save()["weights"]
    assert saved.shape == (1, weights)
    assert np.abs(saved).max() <= 0.1
    assert make("ann-per-action", percept).save()["weights"].shape == (9, weights - 2 * 4)


def test_inputs_of_nets():
    assert Scaled(PERCEPTS["simple"])(np.array([[2.0, 1, 0, 1], [1, 0, 0, 0]])).tolist() == [
        [1, 1, 0, 1],
        [0.5, 0, 0, 0],
    ]
    assert Scaled(PERCEPTS["continuous"])(np.full((1, 12), -1.0)).tolist() == [[0.0] * 12]
    assert OneHot((3, 0, 2))(np.array([[2.0, -0.5, 0.0]])).tolist() == [[0, 0, 1, -0.5, 1, 0]]


@pytest.mark.parametrize("name", ["ann", "ann-linear", "ann-per-action", "elman"])
def test_a_net_comes_to_know_the_value_of_a_state(name):
    learner = make(name, "simple", gamma=0.5)
    state, next_state = (A + learner.context, B + learner.context)
    for _ in range(3000):
        learner.learn(step(state, 3, 2.0, next_state, terminated=True))
        learner.learn(step(state, 4, -2.0, next_state, terminated=True))
    good, bad = learner.values(state)[3:5]
    expected = (2.0, -2.0) if name == "ann-linear" else (0.75, 0.0)  # the paper's mapping of the rewards
    assert (good, bad) == pytest.approx(expected, abs=0.1)


def test_a_dqn_comes_to_know_the_value_of_a_way():
    learner = make("dqn", "simple", gamma=0.5, learning_rate=0.003, learning_rate_end=0.003, target_update_interval=50)
    first, then = (A + learner.context, (*C, 5.0, 2.0))
    for _ in range(600):
        learner.learn(step(first, 3, 0.0, then, first=True))
        learner.learn(step(then, 4, 2.0, first, terminated=True))
    assert learner.values(then)[4] == pytest.approx(2.0, abs=0.15)
    assert learner.values(first)[3] == pytest.approx(1.0, abs=0.15)
    mirrored = context.mirror(PERCEPTS["simple"], first)
    assert learner.values(mirrored)[MIRRORED[3]] == pytest.approx(1.0, abs=0.15)


def test_elman_remembers():
    learner = make("elman", "simple")
    remembered = learner.remember(A + learner.context, 3, 0.0)
    assert len(remembered) == 4
    assert remembered != learner.context
    assert learner.values(A + remembered) != learner.values(A + learner.context)


def test_presets_are_defaults_that_can_be_overruled():
    assert make_setup("mirror").task.scheme().scheme == "potential"
    assert make_setup("mirror", reward="difference").task.scheme().scheme == "difference"
    with pytest.raises(UserError, match=r"no option 'speed' of the learner mirror; there are: .*gamma"):
        make_setup("mirror", speed=3)
    with pytest.raises(UserError, match=r"gamma 1\.5"):
        make_setup("ann", gamma="1.5")
