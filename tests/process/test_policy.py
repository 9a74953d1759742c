"""A policy of Stable-Baselines3 as an agent; the examples against a live bus."""

import base64
import json
import os
import pickle
import subprocess
import sys
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from phototaxis.wire.messages import World
from phototaxis_gym.policy import FrozenPolicy, PolicyAgent
from phototaxis_gym.policy_file import load
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim import arenas
from phototaxis_sim.simulation import Simulation
from rerun_files import series
from stable_baselines3 import A2C, DQN, PPO
from support import observer, phototaxis, wait_status

EXAMPLES = Path(__file__).parents[2] / "examples"
NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"


class Bomb:
    """Touches a file when it is unpickled."""

    def __init__(self, mark: Path):
        self._mark = mark

    def __reduce__(self):
        return (os.mkdir, (str(self._mark),))


@pytest.fixture(scope="module")
def learned(tmp_path_factory) -> Path:
    """A policy that finds the light."""
    file = tmp_path_factory.mktemp("policy") / "ppo.zip"
    words = [sys.executable, EXAMPLES / "sb3.py", "--learner", "ppo", "--steps", "8000", "--save", file]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split("seed 0: ")[1].split("%")[0]) >= 95
    return file


def test_it_takes_the_seat_and_finds_the_light(learned, start, up, world, tmp_path):
    launcher = up("--epochs", 0)
    with observer(world) as bus:
        before = wait_status(bus, lambda status: status.tick > 100, launcher)
        policy = start("agent", "--name", world, "--policy", learned, "--trust", "--take-over")
        seated = wait_status(bus, lambda status: status.driver.startswith("policy-"), launcher, policy)
        later = wait_status(bus, lambda status: status.episodes > seated.episodes + 60, launcher, policy)
        assert later.run == before.run
        assert later.recent > 0.9
        assert policy.stop() == 0
        assert phototaxis("control", "stop", "--name", world).returncode == 0
    assert launcher.end() == 0
    recording = next((tmp_path / "runs").glob("*/recording.rrd"))
    rewards = series(recording, "/plots/reward", "Scalars:scalars")
    assert {tick for tick in rewards if tick > seated.tick}


def test_a_file_is_not_loaded_without_trust(learned, tmp_path):
    bomb, mark = tmp_path / "bomb.zip", tmp_path / "exploded"
    with zipfile.ZipFile(learned) as source, zipfile.ZipFile(bomb, "w") as target:
        for member in source.namelist():
            data = source.read(member)
            if member == "data":
                fields = json.loads(data)
                fuse = base64.b64encode(pickle.dumps(Bomb(mark))).decode()
                fields["lr_schedule"] = {":type:": "x", ":serialized:": fuse}
                data = json.dumps(fields).encode()
            target.writestr(member, data)
    refused = phototaxis("agent", "--policy", bomb)
    assert refused.returncode == 2
    assert "can run any code when it is loaded; if you trust who made it, add --trust" in refused.stderr
    assert not mark.exists()
    with suppress(Exception):
        PPO.load(bomb)
    assert mark.exists(), "the warning is true"


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda file: None, "there is no such file"),
        (lambda file: file.write_text("x"), "not a policy that Stable-Baselines3 has saved"),
        (lambda file: zipfile.ZipFile(file, "w").close(), "not a policy that Stable-Baselines3 has saved"),
        (lambda file: DQN("MlpPolicy", "CartPole-v1").save(file), "not the spaces of an environment of phototaxis"),
    ],
)
def test_what_is_no_policy_of_ours_is_one_line(make, line, tmp_path, start, world):
    file = tmp_path / "p.zip"
    make(file)
    if "spaces" in line:
        start("sim", "--name", world)
        start("sensors", "--name", world)
    agent = start("agent", "--name", world, "--policy", file, "--trust")
    assert agent.end() == 2
    assert line in agent.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("kind", "percept", "action"),
    [
        (DQN, "rich", "discrete"), (DQN, "sensors", "discrete"), (PPO, "rich", "discrete"),
        (PPO, "sensors", "continuous"), (A2C, "sensors", "discrete"), (A2C, "simple", "continuous"),
    ],
)  # fmt: skip
def test_any_percept_and_action_of_the_environment_can_be_seated(kind, percept, action, tmp_path):
    environment: Any = gymnasium.make(NAME, percept=percept, action=action)
    kind("MlpPolicy", environment, device="cpu").save(tmp_path / "p.zip")
    model = load(tmp_path / "p.zip", trusted=True)
    assert isinstance(model, kind)
    world = World(run="r", arena=arenas.load("paper"), seed=0, epochs=0)
    agent = PolicyAgent(FrozenPolicy(model, tmp_path / "p.zip", world.arena), 50)
    simulation = Simulation(world.arena, 0, "r")
    suite = SensorSuite(simulation.world)
    seen, _ = environment.reset(seed=0)
    for _ in range(20):
        command = agent(suite(simulation.state))
        if command.end:
            break
        chosen, _ = model.predict(seen, deterministic=True)
        seen, _, _, _, info = environment.step(chosen)
        simulation.advance(command.left, command.right, command.author, command.end)
        state = simulation.state
        assert info["pose"].tolist() == [state.x, state.y, state.heading]


def test_the_examples_learn_against_a_live_bus(start, world):
    sim = start("sim", "--name", world)
    start("sensors", "--name", world)
    words = ["--connect", "local", "--world", world]
    for learner, steps in (("dqn", 300), ("ppo", 512)):
        example = [sys.executable, EXAMPLES / "sb3.py", "--learner", learner, "--steps", str(steps), *words]
        done = subprocess.run(example, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert f"{learner}, {steps} steps" in done.stdout
    sim.alive()


def test_the_single_file_script_learns_here_and_behind_the_bus(start, world):
    start("sim", "--name", world, "--robots", 16)
    start("sensors", "--name", world)
    script = [sys.executable, EXAMPLES / "cleanrl_dqn.py", "--steps", "12000"]
    printed = set()
    for where in ([], ["--connect", "local", "--world", world]):
        done = subprocess.run([*script, *where], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        printed.add(done.stdout)
    assert len(printed) == 1, "the same experience, the same policy"
    assert float(printed.pop().split("seed 0: ")[1].split("%")[0]) >= 95
