"""Files of Stable-Baselines3 and sb3-contrib: they drive as they were trained, or are refused by name."""

import pickle
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import decode, encode
from phototaxis.runtime.errors import UserError
from phototaxis.task import BatchObservation, Episode
from phototaxis.task.episode import RESET
from phototaxis.wire.columns import FLAG, pack, unpack
from phototaxis.wire.messages import ENDS, BatchReadings, Readings, World
from phototaxis_agent.batch_driver import BatchDriver
from phototaxis_gym.backend import LocalBackend
from phototaxis_gym.policy import PolicyAgent, PolicyFile
from phototaxis_gym.sb3 import Robots
from phototaxis_lab import evaluate
from phototaxis_sensors.batch_suite import BatchSuite
from phototaxis_sim.batch_simulation import BatchSimulation
from sb3_contrib import ARS, QRDQN, TQC, TRPO, CrossQ, MaskablePPO, RecurrentPPO
from stable_baselines3 import A2C, DDPG, DQN, PPO, SAC, TD3
from stable_baselines3.common.callbacks import EvalCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecFrameStack, VecMonitor, VecNormalize

NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"
MAX_STEPS = 12


@pytest.fixture(autouse=True)
def one_thread():
    """The nets are small: threads only cost."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


class OwnPolicy(ActorCriticPolicy):
    """A class that only its author has."""


def save(
    kind: Any, folder: Path, policy: Any = "MlpPolicy", percept="sensors", action="continuous", **more: Any
) -> Path:
    """A file with an untrained policy."""
    file = folder / "policy.zip"
    kind(policy, gymnasium.make(NAME, percept=percept, action=action), device="cpu", seed=1, **more).save(file)
    return file


def agent(file: Path, paper: Arena, **more: Any) -> PolicyAgent:
    return PolicyFile(file, trusted=True, **more)(World(run="x", arena=paper, seed=5, epochs=0), MAX_STEPS)


def drive(agents: list[PolicyAgent], paper: Arena, ticks: int) -> list[list[tuple[float, float, str]]]:
    """The commands of agents that see the same; the first one drives."""
    place, found = LocalBackend(paper), []
    readings = place.begin(5)
    for _ in range(ticks):
        commands = [one(readings) for one in agents]
        found.append([(command.left, command.right, command.end) for command in commands])
        first = commands[0]
        readings = place.place(first.end) if first.end else place.drive(first.left, first.right)
    return found


def expected(model: Any, ticks: int, normalize: Any = lambda seen: seen, **options: Any) -> list[tuple]:
    """The commands that `predict` chooses as its documentation has it, for the same placements."""
    environment: Any = gymnasium.make(NAME, max_episode_steps=MAX_STEPS, **options)
    seen, _ = environment.reset(seed=5)
    found, memory, start = list[tuple](), None, True
    while len(found) < ticks:
        action, memory = model.predict(
            normalize(seen), state=memory, episode_start=np.array([start]), deterministic=True
        )
        seen, _, terminated, truncated, _ = environment.step(action)
        start = terminated or truncated
        readings = environment.unwrapped._episode.now
        found.append((readings.left, readings.right, ""))
        if start:
            found.append((0.0, 0.0, "terminated" if terminated else "truncated"))
            seen, _ = environment.reset()
    return found[:ticks]


ANY = [
    (A2C, "discrete"), (PPO, "discrete"), (PPO, "continuous"), (DQN, "discrete"), (SAC, "continuous"),
    (TD3, "continuous"), (DDPG, "continuous"), (ARS, "discrete"), (ARS, "continuous"), (QRDQN, "discrete"),
    (TQC, "continuous"), (TRPO, "continuous"), (CrossQ, "continuous"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "action"), ANY)
def test_every_algorithm_drives_as_its_own_predict(kind, action, paper, tmp_path):
    file = save(kind, tmp_path, action=action)
    found = [commands[0] for commands in drive([agent(file, paper)], paper, 30)]
    assert found == expected(kind.load(file), 30, percept="sensors", action=action)


@pytest.mark.parametrize("percept", ["simple", "sensors"])
def test_a_recurrent_policy_keeps_its_memory_within_each_episode(percept, paper, tmp_path):
    file = save(RecurrentPPO, tmp_path, "MlpLstmPolicy", percept=percept)
    found = [commands[0] for commands in drive([agent(file, paper)], paper, 30)]
    model = RecurrentPPO.load(file)
    assert found == expected(model, 30, percept=percept, action="continuous")

    class Forgetful:
        def predict(self, seen: Any, **_: Any) -> Any:
            return model.predict(seen, deterministic=True)

    assert found != expected(Forgetful(), 30, percept=percept, action="continuous")


def test_a_successor_inherits_the_memory(paper, tmp_path):
    file = save(RecurrentPPO, tmp_path, "MlpLstmPolicy")
    first, second = agent(file, paper), agent(file, paper)
    drive([first], paper, 7)
    second.restore(*decode(encode(*first.checkpoint()), "first"), "first")
    for hidden, other in zip(first.hidden or (), second.hidden or (), strict=True):
        np.testing.assert_array_equal(hidden, other)
    assert first.hidden is not None
    other = agent(save(PPO, tmp_path), paper)
    with pytest.raises(UserError, match="first: its hidden state does not fit the policy in"):
        other.restore(*first.checkpoint(), "first")


def test_many_robots_are_driven_as_one(paper, tmp_path):
    """In an evaluation: each robot has a memory of its own."""
    file = save(RecurrentPPO, tmp_path, "MlpLstmPolicy")
    batch, alone = PolicyFile(file, trusted=True).batch(paper), agent(file, paper)
    place, episode = LocalBackend(paper), Episode(MAX_STEPS, 2)
    readings = place.begin(5)
    for step in range(8):
        rows = BatchObservation(
            np.array([readings.sonar, [8.0] * 16]).T, np.array([readings.light, (0.1, 0.2)]).T,
            np.array([readings.front, False]), np.array([readings.rear, True]),
        )  # fmt: skip
        command = alone(readings)
        (episode.step if step else episode.begin)(rows)
        np.testing.assert_allclose(batch(episode)[0], (command.left, command.right), atol=1e-6)
        readings = place.drive(command.left, command.right)


def test_a_policy_drives_the_robots_of_a_world_each_in_its_own_episode(paper, tmp_path):
    file = save(RecurrentPPO, tmp_path, "MlpLstmPolicy")
    simulation = BatchSimulation(paper, 5, "x", robots=3)
    suite, flock = BatchSuite(simulation.world), BatchDriver(agent(file, paper), 3)
    alone = [agent(file, paper) for _ in range(3)]
    for _ in range(2 * MAX_STEPS):
        state = simulation.state
        sonar, light = suite(state.tick, simulation.poses)
        command = flock(
            BatchReadings(
                run="x", tick=state.tick, epoch=state.epoch, episode=state.episode, sonar=pack(sonar),
                light=pack(light), contact=state.contact, left=state.left, right=state.right, author="", driver="",
            )
        )  # fmt: skip
        ends = unpack(command.end, 3, kind=FLAG)
        for row, one in enumerate(alone):
            answer = one(
                Readings(
                    run="x", tick=state.tick, episode=simulation.episode[row], epoch=state.epoch,
                    sonar=sonar[:, row].tolist(), light=tuple(light[:, row].tolist()), front=simulation.front[row],
                    rear=simulation.rear[row], left=0.0, right=0.0, author="", driver="",
                )
            )  # fmt: skip
            motors = unpack(command.left, 3)[row], unpack(command.right, 3)[row]
            assert (*motors, ENDS[ends[row]]) == (answer.left, answer.right, answer.end)
        reset = pack(np.array([0, RESET, 0]), FLAG)  # so that the episodes end at different ticks
        simulation.advance(command.left, command.right, "x", reset if state.tick == 5 else command.end)


def normalized(folder: Path, **more: Any) -> tuple[Path, VecNormalize]:
    """A policy that has learned a little through VecNormalize, and its statistics."""
    robots = VecNormalize(make_vec_env(NAME, n_envs=2, seed=1, env_kwargs={"percept": "continuous"}), **more)
    model = PPO("MlpPolicy", robots, device="cpu", seed=1, n_steps=32, n_epochs=1)
    model.learn(64)
    model.save(folder / "policy.zip")
    robots.save(str(folder / "statistics.pkl"))
    return folder / "policy.zip", robots


def test_the_statistics_of_vecnormalize_are_taken_along(paper, tmp_path):
    file, robots = normalized(tmp_path)
    with pytest.raises(
        UserError, match=r"trained through VecNormalize and needs its statistics.*--normalize FILE\.pkl"
    ):
        agent(file, paper)
    driver = agent(file, paper, normalize=tmp_path / "statistics.pkl")
    found = [commands[0] for commands in drive([driver], paper, 30)]
    assert found == expected(PPO.load(file), 30, robots.normalize_obs, percept="continuous")


@pytest.mark.parametrize("kind", [DQN, SAC, TQC])
def test_with_a_replay_buffer_only_normalised_observations_need_statistics(kind, paper, tmp_path):
    options = {"percept": "continuous", "action": "discrete" if kind is DQN else "continuous"}
    for wrap in (lambda robots: robots, VecNormalize, lambda robots: VecNormalize(robots, norm_obs=False)):
        robots = wrap(make_vec_env(NAME, n_envs=2, seed=1, env_kwargs=options))
        model = kind("MlpPolicy", robots, device="cpu", seed=1, learning_starts=40, buffer_size=100, batch_size=8)
        model.learn(44)
        model.save(tmp_path / "policy.zip")
        if wrap is VecNormalize:
            with pytest.raises(UserError, match="trained through VecNormalize and needs its statistics"):
                agent(tmp_path / "policy.zip", paper)
        else:
            agent(tmp_path / "policy.zip", paper)


def test_only_normalised_rewards_need_no_statistics(paper, tmp_path):
    file, _ = normalized(tmp_path, norm_obs=False)
    wanted = expected(PPO.load(file), 30, percept="continuous")
    for statistics in (tmp_path / "statistics.pkl", Path("none")):
        driver = agent(file, paper, normalize=statistics)
        assert [commands[0] for commands in drive([driver], paper, 30)] == wanted


def test_statistics_that_do_not_fit_are_one_line(paper, tmp_path):
    file, _ = normalized(tmp_path)
    (tmp_path / "list.pkl").write_bytes(pickle.dumps([1]))
    (tmp_path / "text.pkl").write_text("x")
    (tmp_path / "other").mkdir()
    other = save(PPO, tmp_path / "other")
    for policy, statistics, line in (
        (file, "none.pkl", "none.pkl: there is no such file"),
        (file, "list.pkl", "not what VecNormalize.save writes, but a list"),
        (file, "text.pkl", "text.pkl: cannot be loaded: "),
        (other, "statistics.pkl", r"statistics of observations of the shape \(12,\); the policy observes"),
    ):
        with pytest.raises(UserError, match=line):
            agent(policy, paper, normalize=tmp_path / statistics)


def stacked(folder: Path, percept="continuous", frames=4) -> None:
    robots = VecFrameStack(make_vec_env(NAME, n_envs=1, env_kwargs={"percept": percept}), frames)
    PPO("MlpPolicy", robots, device="cpu").save(folder / "policy.zip")


def running_mean(folder: Path) -> None:
    environment = gymnasium.wrappers.NormalizeObservation(gymnasium.make(NAME, percept="continuous"))
    PPO("MlpPolicy", environment, device="cpu").save(folder / "policy.zip")


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (stacked, r"observes Box.*\(48,\).*4 frames of continuous stacked\? .* not supported"),
        (lambda folder: stacked(folder, "sensors", 3), r"\(3 frames of sensors stacked\?"),
        (running_mean, r"continuous through NormalizeObservation\? train through VecNormalize"),
        (
            lambda folder: save(MaskablePPO, folder, action="discrete"),
            "policies of MaskablePPO are not supported: they need",
        ),
    ],
)
def test_what_cannot_drive_as_it_was_trained_is_refused_by_name(make, line, paper, tmp_path):
    make(tmp_path)
    with pytest.raises(UserError, match=line):
        agent(tmp_path / "policy.zip", paper)


def test_a_policy_of_a_class_of_ones_own_is_recognised(paper, tmp_path):
    file = save(PPO, tmp_path, OwnPolicy)
    found = [commands[0] for commands in drive([agent(file, paper)], paper, 20)]
    assert found == expected(PPO.load(file), 20, percept="sensors", action="continuous")


def test_evaluate_takes_such_files(tmp_path, capsys):
    file, _ = normalized(tmp_path)
    words = [str(file), "--placements", "3", "--max-episode-steps", "5", "--json"]
    for more, line in (
        ([], "add --trust"),
        (["--trust"], "needs its statistics"),
        (["--trust", "--normalize", str(tmp_path / "no.pkl")], "there is no such file"),
    ):
        with pytest.raises(UserError, match=line):
            evaluate.main([*words, *more])
    assert evaluate.main([*words, "--trust", "--normalize", str(tmp_path / "statistics.pkl")]) == 0
    assert '"placements":3' in capsys.readouterr().out
    with pytest.raises(UserError, match="--normalize belongs to a policy"):
        evaluate.main(["kept.npz", "--normalize", "x.pkl"])


def test_stable_baselines_counts_successes(tmp_path):
    robots = make_vec_env(NAME, n_envs=2, seed=1, env_kwargs={"percept": "continuous", "max_episode_steps": 30})
    judge = EvalCallback(
        make_vec_env(NAME, n_envs=2, env_kwargs={"max_episode_steps": 30, "percept": "continuous"}),
        n_eval_episodes=4,
        eval_freq=64,
        verbose=0,
        log_path=str(tmp_path),
    )
    model = PPO("MlpPolicy", robots, device="cpu", n_steps=64, n_epochs=1)
    model.learn(256, judge)
    assert len(judge._is_success_buffer) == 4
    assert len(model.ep_success_buffer or ()) > 2
    assert np.load(tmp_path / "evaluations.npz")["successes"].shape[1] == 4


def test_many_robots_are_a_vecenv_of_stable_baselines(quiet):
    """Step by step as its own loop over single robots, with the last observations of episodes."""
    options = {"percept": "sensors", "arena": quiet, "max_episode_steps": 15}
    ours, theirs = Robots(3, **options), make_vec_env(NAME, n_envs=3, env_kwargs=options)
    rng, ends = np.random.default_rng(0), 0
    for environment in (ours, theirs):
        environment.seed(4)
        environment.set_options({"pose": (5.0, 5.0, 1.0)})
    for _ in range(2):  # at the pose, and then at a random place again
        np.testing.assert_allclose(np.asarray(ours.reset()), np.asarray(theirs.reset()), atol=1e-4)
    for _ in range(60):
        actions = rng.integers(9, size=3)
        mine, its = ours.step(actions), theirs.step(actions)
        for one, other in zip(mine[:3], its[:3], strict=True):
            np.testing.assert_allclose(np.asarray(one), np.asarray(other), atol=1e-4)
        for row in np.flatnonzero(mine[2]):
            ends += 1
            one, other = mine[3][row], its[3][row]
            np.testing.assert_allclose(one["terminal_observation"], other["terminal_observation"], atol=1e-4)
            assert one["is_success"] == other["is_success"]
            assert one["TimeLimit.truncated"] == other["TimeLimit.truncated"]
    assert ends > 8
    model = PPO(
        "MlpPolicy",
        VecMonitor(Robots(4, percept="continuous", max_episode_steps=20)),
        device="cpu",
        n_steps=32,
        n_epochs=1,
    )
    model.learn(256)
    assert len(model.ep_success_buffer or ()) > 2
