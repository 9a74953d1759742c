"""Many robots at once obey the laws of one: physics, sensors, percepts, draws."""

from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from making import readings
from phototaxis.geometry.arena import Arena
from phototaxis.task import MOTORS, PERCEPTS, BatchObservation, Episode, LightHistory
from phototaxis.wire.messages import World
from phototaxis_agent.batch_agent import draw_batch, stack_columns
from phototaxis_agent.exploration import draw
from phototaxis_agent.setup import make_setup
from phototaxis_lab.measure import direct_steps, evaluate, measure
from phototaxis_sensors.batch_suite import BatchSuite
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim import arenas
from phototaxis_sim.batch_physics import BatchPhysics
from phototaxis_sim.physics import Physics, Pose
from phototaxis_sim.simulation import Simulation

COUNT = 12


def placed(arena: Arena, count: int = COUNT) -> list[Pose]:
    physics, rng = Physics(arena), np.random.default_rng(3)
    return [physics.random_pose(rng) for _ in range(count)]


@pytest.mark.parametrize("name", arenas.shipped())
def test_a_crowd_moves_as_each_robot_would_alone(name):
    arena = arenas.load(name)
    poses, rng = placed(arena), np.random.default_rng(0)
    batch, alone = BatchPhysics(arena, poses), [Physics(arena) for _ in poses]
    for physics, pose in zip(alone, poses, strict=True):
        physics.place(pose)
    touched = 0
    for tick in range(120):
        if tick % 20 == 9:  # some begin anew, whatever they touch
            for row in range(tick // 20, COUNT, 3):
                pose = alone[row].random_pose(rng)
                batch.place(row, pose)
                alone[row].place(pose)
        motors = MOTORS[rng.integers(9, size=COUNT)] if tick % 20 > 10 else np.ones((COUNT, 2))
        batch.drive(*motors.T)
        motions = [physics.drive(*command) for physics, command in zip(alone, motors.tolist(), strict=True)]
        difference = batch.poses - np.array([motion.pose for motion in motions])
        difference[:, 2] -= 2 * np.pi * np.round(difference[:, 2] / (2 * np.pi))
        assert np.abs(difference).max() < 1e-9
        assert batch.front.tolist() == [motion.front for motion in motions]
        assert batch.rear.tolist() == [motion.rear for motion in motions]
        touched += batch.front.sum() + batch.rear.sum()
    assert touched > 20


@pytest.mark.parametrize("name", arenas.shipped())
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_crowd_senses_as_each_robot_would_alone(name, noise):
    arena = arenas.load(name)
    arena = msgspec.structs.replace(arena, sensing=msgspec.structs.replace(arena.sensing, noise=noise))
    world, physics, rng = World(run="r", arena=arena, seed=5, epochs=0), Physics(arena), np.random.default_rng(1)
    suite, batch, state = SensorSuite(world), BatchSuite(world), Simulation(arena, 0, "r").state
    lit = 0
    for tick in range(300):
        pose = state.x, state.y, state.heading = physics.random_pose(rng)
        state.tick = tick
        alone = suite(state)
        sonar, light = batch(tick, np.array([pose]))
        assert sonar[:, 0] == pytest.approx(alone.sonar, abs=1e-9)
        assert light[:, 0] == pytest.approx(alone.light, abs=1e-9)
        lit += max(alone.light) > 0
    assert lit > 100


@pytest.mark.parametrize("name", PERCEPTS)
def test_percepts_of_arrays_are_those_of_numbers(name):
    rng, percept = np.random.default_rng(2), PERCEPTS[name]
    histories, together = [LightHistory() for _ in range(COUNT)], LightHistory(COUNT)
    seen = set()
    for tick in range(30):
        light = rng.uniform(0, 1, (2, COUNT)) if tick % 10 < 3 else np.full((2, COUNT), 0.3)
        sonar, bumps = rng.uniform(0, 2, (16, COUNT)), rng.random((2, COUNT)) < 0.3
        observation = BatchObservation(sonar, light, *bumps)
        (together.step if tick else together.begin)(light)
        states = stack_columns(percept.state(observation, together, 0.4), COUNT)
        for robot, history in enumerate(histories):
            left, right = light[:, robot].tolist()
            front, rear = bumps[:, robot].tolist()
            one = readings(tick, (left, right), sonar=sonar[:, robot].tolist(), front=front, rear=rear)
            (history.step if tick else history.begin)(one.light)
            state = percept.state(one, history, 0.4)
            assert states[robot].tolist() == pytest.approx(list(state))
            assert len(state) == len(percept.sizes) == len(percept.variables)
            seen.add(state)
    assert len(seen) > 20 or name == "simple"
    if all(percept.sizes):
        assert {1 * history.unchanged for history in histories} == {1}


def test_draws_of_many_are_draws_of_one():
    rng = np.random.default_rng(4)
    values, uniform = rng.normal(size=(500, 9)), rng.random(500)
    one_by_one = [draw(row, 0.3, u) for row, u in zip(values.tolist(), uniform.tolist(), strict=True)]
    assert draw_batch(values, 0.3, uniform).tolist() == one_by_one


def test_an_evaluation_follows_from_its_seed(paper: Arena):
    policy = make_setup().agent(World(run="r", arena=paper, seed=0, epochs=10), learning=False).policy
    steps: list[None] = []
    first = evaluate(paper, policy, 20, seed=3, max_episode_steps=30, stepped=lambda: steps.append(None))
    assert 0 < len(steps) <= 30
    assert first == evaluate(paper, policy, 20, seed=3, max_episode_steps=30)
    assert first != evaluate(paper, policy, 20, seed=4, max_episode_steps=30)


def test_an_agent_that_learns_is_not_evaluated(paper: Arena):
    with pytest.raises(ValueError, match="must not learn"):
        evaluate(paper, make_setup().agent(World(run="r", arena=paper, seed=0, epochs=10)).policy, 5, seed=0)


def test_the_direct_way_is_turning_and_driving(paper: Arena):
    # 3 m left of the light: 3 − 0.225 − 1.026 m to go, 0.5 m a step; behind it: a half turn at 0.5 rad a step first
    straight = 2 * (3 - 0.225 - 0.95**-0.5)
    assert direct_steps(paper, Pose(2, 5, 0)) == pytest.approx(straight)
    assert direct_steps(paper, Pose(2, 5, np.pi)) == pytest.approx(straight + 2 * np.pi)
    assert direct_steps(paper, Pose(4, 5, 0)) == 1


def scripted(motors: tuple[float, float]) -> Callable[[Episode], np.ndarray]:
    return lambda episode: np.tile(motors, (len(episode.now.front), 1))


def test_success_is_counted_where_the_light_is_reached(paper: Arena):
    still = measure(paper, scripted((0, 0)), 30, seed=1, max_episode_steps=20)
    assert (still.success_rate, still.steps_mean, still.path_ratio) == (0, None, None)
    ahead = measure(paper, scripted((1, 1)), 200, seed=1, max_episode_steps=40)
    assert 0.05 < ahead.success_rate < 0.5
    assert ahead.path_ratio is not None
    assert 0.9 < ahead.path_ratio < 1.3
