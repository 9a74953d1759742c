"""The Gymnasium environments: they keep its rules, and do what the simulation does."""

import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import Error, InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env
from phototaxis.task import ACTIONS, REWARDS
from phototaxis.wire.messages import World
from phototaxis_agent.setup import make_setup
from phototaxis_gym.single import LightSeeker
from phototaxis_lab.loop import Loop
from phototaxis_sim import arenas
from stable_baselines3.common.env_checker import check_env as check_env_for_sb3

ROOT = Path(__file__).parents[2]
NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"
PERCEPTS = ("simple", "rich", "continuous", "sensors")
VARIANTS = [(percept, action) for percept in PERCEPTS for action in ("discrete", "continuous")]


@pytest.mark.parametrize(("percept", "action"), VARIANTS)
def test_the_checkers_find_nothing(percept, action, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        environment = gymnasium.make(NAME, percept=percept, action=action, render_mode="rgb_array")
        check_env(environment.unwrapped)
        check_env_for_sb3(environment)


def test_it_is_found_without_importing_us():
    script = (
        f"import gymnasium; print(gymnasium.make({NAME!r}).reset(seed=1)[0], gymnasium.make_vec({NAME!r}, num_envs=3))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "num_envs=3" in done.stdout


def test_it_does_what_an_agent_in_one_process_meets():
    """The same placements, readings and rewards as the loop of `phototaxis train`, action by action."""
    arena, episodes, reward = arenas.load("paper"), 0, 0.0
    agent = make_setup("qtable").agent(World(run="x", arena=arena, seed=5, epochs=0))
    loop = Loop(arena, agent, 5)
    environment = gymnasium.make(NAME, max_episode_steps=100)
    seen, _ = environment.reset(seed=5)
    for _ in range(600):
        ended = loop.step()
        assert int(seen) == agent.last.percept
        if ended is None:
            seen, reward, _, _, info = environment.step(agent.last.action)
            state = loop.simulation.state
            np.testing.assert_array_equal(info["pose"], (state.x, state.y, state.heading))
        else:
            episodes += 1
            assert reward == agent.last.reward
            seen, _ = environment.reset()
    assert episodes > 3


def test_seeds_are_honoured():
    first, second = (gymnasium.make(NAME, percept="sensors") for _ in range(2))
    actions = np.random.default_rng(1).integers(9, size=200)

    def walk(environment: gymnasium.Env, seed: int) -> np.ndarray:
        seen = [environment.reset(seed=seed)[0]]
        for action in actions:
            found, _, terminated, truncated, _ = environment.step(action)
            seen.append(environment.reset()[0] if terminated or truncated else found)
        return np.array(seen)

    np.testing.assert_array_equal(walk(first, 3), walk(second, 3))
    np.testing.assert_array_equal(walk(first, 3), walk(second, 3))
    assert not np.array_equal(walk(first, 3), walk(second, 4))


def test_terminated_is_the_light_and_truncated_the_last_step():
    environment = gymnasium.make(NAME, percept="sensors", max_episode_steps=50)
    ends = {"terminated": 0, "truncated": 0}
    environment.reset(seed=0)
    steps, rng = 0, np.random.default_rng(0)
    for _ in range(3000):
        seen, reward, terminated, truncated, _ = environment.step(rng.integers(9))
        steps += 1
        assert terminated == (max(seen[:2]) > 0.95)
        assert truncated == (steps == 50)
        ends["terminated"] += terminated
        ends["truncated"] += truncated
        if terminated:
            assert reward == REWARDS["potential"].goal
        if terminated or truncated:
            environment.reset()
            steps = 0
    assert min(ends.values()) > 0


@pytest.mark.parametrize("percept", PERCEPTS)
def test_many_robots_do_what_each_would_do_alone(percept, quiet):
    options = {"percept": percept, "arena": quiet, "max_episode_steps": 60}
    count = 5
    many = gymnasium.make_vec(NAME, num_envs=count, **options)
    singles = [gymnasium.make(NAME, **options) for _ in range(count)]
    together, _ = many.reset(seed=3)
    alone = [environment.reset(seed=3 + i)[0] for i, environment in enumerate(singles)]
    np.testing.assert_allclose(together, np.array(alone), atol=1e-4)
    rng, over, ends = np.random.default_rng(0), [False] * count, 0
    for _ in range(400):
        actions = rng.integers(9, size=count)
        together, rewards, terminated, truncated, _ = many.step(actions)
        for row, environment in enumerate(singles):
            if over[row]:
                seen, reward, ended, cut = environment.reset()[0], 0.0, False, False
            else:
                seen, reward, ended, cut, _ = environment.step(actions[row])
            np.testing.assert_allclose(together[row], seen, atol=1e-4)
            assert rewards[row] == pytest.approx(reward, abs=1e-4)
            assert (terminated[row], truncated[row]) == (ended, cut)
            over[row] = ended or cut
            ends += over[row]
    assert ends > 10


def test_continuous_wheels_and_the_nine_actions_agree(quiet):
    nine = gymnasium.make(NAME, percept="sensors", arena=quiet)
    wheels = gymnasium.make(NAME, percept="sensors", arena=quiet, action="continuous")
    np.testing.assert_array_equal(nine.reset(seed=2)[0], wheels.reset(seed=2)[0])
    for number in np.random.default_rng(0).integers(9, size=30):
        wheel = np.array(ACTIONS[number], np.float32)
        np.testing.assert_array_equal(nine.step(number)[0], wheels.step(wheel)[0])


@pytest.mark.parametrize("make", [gymnasium.make, lambda name, **more: gymnasium.make_vec(name, num_envs=2, **more)])
@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"percept": "x-ray"}, "no percept 'x-ray'; there are: simple, rich, continuous, sensors"),
        ({"arena": "mars"}, "no arena 'mars'"),
        ({"reward": "praise"}, "no reward 'praise'; there are: own, difference"),
        ({"action": "jump"}, "no actions 'jump'; there are: discrete, continuous"),
        ({"connect": "local", "world": "a/*"}, r"world 'a/\*': up to 40 letters"),
        ({"connect": "127.0.0.1:7447"}, "an endpoint is like tcp/127.0.0.1:7447"),
    ],
)
def test_options_that_do_not_exist_are_gymnasiums_own_error(make, options, line):
    with pytest.raises((Error, TypeError), match=line):
        make(NAME, **options)


def test_one_robot_has_the_render_modes_that_it_says():
    with pytest.raises(Error, match="no render_mode 'ansi'; there are: rgb_array, human"):
        LightSeeker(render_mode="ansi")


@pytest.mark.parametrize("seed", [[1, 2], [1, 2, 3, 4]])
def test_many_robots_take_one_seed_each(seed):
    with pytest.raises(Error, match="one number, or one for each of the 3 robots"):
        gymnasium.make_vec(NAME, num_envs=3).reset(seed=seed)


@pytest.mark.parametrize("count", [0, -1])
def test_many_robots_are_at_least_one(count):
    with pytest.raises(Error, match="at least one robot"):
        gymnasium.make_vec(NAME, num_envs=count)


def test_wrong_actions_and_steps_out_of_order_are_gymnasiums_own_errors():
    environment = gymnasium.make(NAME, disable_env_checker=True).unwrapped
    many = gymnasium.make_vec(NAME, num_envs=2)
    wheels = gymnasium.make_vec(NAME, num_envs=2, action="continuous")
    with pytest.raises(ResetNeeded):
        environment.step(0)
    with pytest.raises(ResetNeeded):
        many.step(np.array([0, 1]))
    for one in (environment, many, wheels):
        one.reset(seed=0)
    with pytest.raises(InvalidAction):
        environment.step(9)
    for wrong in ([0, 9], [0], [0.5, 1.0], [-1, 0]):
        with pytest.raises(InvalidAction):
            many.step(np.array(wrong))
    with pytest.raises(InvalidAction):
        wheels.step(np.array([[0.0, np.nan], [0.0, 0.0]]))


def test_pictures(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    for arena in ("paper", "doorway", "shadows"):
        environment = gymnasium.make(NAME, arena=arena, render_mode="rgb_array")
        environment.reset(seed=1)
        before: Any = environment.render()
        environment.step(4)
        after: Any = environment.render()
        assert isinstance(before, np.ndarray)
        assert before.shape[2] == 3
        assert before.dtype == np.uint8
        assert not np.array_equal(before, after)
    window = gymnasium.make(NAME, render_mode="human")
    window.reset(seed=1)
    window.step(4)
    assert window.render() is None
    window.close()


@pytest.mark.parametrize(("learner", "steps"), [("dqn", 4000), ("ppo", 6000)])
def test_the_example_of_stable_baselines_learns(learner, steps):
    words = [sys.executable, ROOT / "examples/sb3.py", "--learner", learner, "--steps", str(steps)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split("seed 0: ")[1].split("%")[0]) >= 95
