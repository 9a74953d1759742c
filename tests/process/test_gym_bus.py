"""The Gymnasium environment as a client of a running system: the same trajectories, rules and errors."""

import copy
import pickle
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, Error, InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env
from phototaxis.runtime.ports import free_ports
from rerun_files import series
from stable_baselines3.common.env_checker import check_env as check_env_for_sb3
from support import Process, observer, phototaxis, wait_alive, wait_status

NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"
PERCEPTS = ("simple", "rich", "continuous", "sensors")
VARIANTS = [(percept, action) for percept in PERCEPTS for action in ("discrete", "continuous")]


@pytest.fixture
def system(start: Callable[..., Process], world: str) -> Iterator[dict[str, Process]]:
    """A simulation and sensors that wait for a driver."""
    started = {role: start(role, "--name", world) for role in ("sim", "sensors")}
    with observer(world) as bus:
        wait_alive(bus, "sensors", *started.values())
    yield started
    for process in started.values():
        process.kill()


def make(world: str, **options) -> gymnasium.Env:
    return gymnasium.make(NAME, connect="local", world=world, timeout=20.0, **options)


def walk(environment: gymnasium.Env, steps: int, seed: int) -> list[tuple]:
    """What it answers to random actions, with resets at the ends and a seed in the middle."""
    rng = np.random.default_rng(seed)
    seen, found = environment.reset(seed=seed)[0], []
    for step in range(steps):
        answer = environment.step(rng.integers(9))
        found.append((seen, *answer[:4], answer[4]["tick"], answer[4]["episode_number"]))
        seen = answer[0]
        if step == steps // 2:
            seen = environment.reset(seed=seed + 1)[0]
        elif answer[2] or answer[3] or rng.random() < 0.01:
            seen = environment.reset()[0]
    return found


def test_ten_thousand_steps_are_the_same_here_and_there(system, world):
    here, there = gymnasium.make(NAME, percept="sensors"), make(world, percept="sensors")
    for one, other in zip(walk(here, 10_000, 5), walk(there, 10_000, 5), strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
        assert one[2:] == other[2:]
    there.close()


def test_through_a_router(start, world):
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    router = start("router", "--listen", endpoint)
    there = ["--name", world, "--connect", endpoint]
    deadline = time.monotonic() + 20
    while phototaxis("health", "router", "--connect", endpoint).returncode:
        router.alive()
        assert time.monotonic() < deadline
    started = [start("sim", *there), start("sensors", *there)]
    here = gymnasium.make(NAME, percept="continuous")
    remote = gymnasium.make(NAME, percept="continuous", connect=endpoint, world=world, timeout=20.0)
    for one, other in zip(walk(here, 300, 5), walk(remote, 300, 5), strict=True):
        np.testing.assert_array_equal(one[1], other[1])
        assert one[2:] == other[2:]
    remote.close()
    for process in started:
        process.alive()


def test_the_checkers_find_nothing(system, world):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for percept, action in VARIANTS:
            environment = make(world, percept=percept, action=action)
            check_env(environment.unwrapped)
            check_env_for_sb3(environment)
            environment.close()


def test_it_takes_the_seat_of_a_recorded_run_and_leaves_it(start, up, world, tmp_path):
    launcher = up("--epochs", 0)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 50, launcher)
        environment = make(world, percept="continuous")
        environment.reset(seed=3)
        for _ in range(30):
            environment.step(4)
        status = wait_status(bus, lambda status: status.driver.startswith("gymnasium-"), launcher)
        environment.close()
        wait_status(bus, lambda status: status.driver.startswith("qtable-"), launcher)  # it had waited
    launcher.popen.send_signal(signal.SIGTERM)
    assert launcher.end() == 0
    recordings = sorted((tmp_path / "runs").glob("*/recording*.rrd"))
    assert len(recordings) == 2, "a seed is a new run"
    trail = series(recordings[-1], "/world/trail", "Points2D:positions")
    assert set(range(20)) <= set(trail)
    assert status.run


def test_errors_are_gymnasiums_own(system, world, start):
    environment = make(world)
    with pytest.raises(ResetNeeded):
        environment.unwrapped.step(0)
    environment.reset(seed=1)
    with pytest.raises(InvalidAction):
        environment.unwrapped.step(9)
    with pytest.raises(Error, match="render_mode 'rgb_array': the running system decides that"):
        make(world, render_mode="rgb_array")
    with pytest.raises(Error, match="arena 'doorway': the running system decides that"):
        make(world, arena="doorway")
    with pytest.raises(TypeError, match="cannot be copied or pickled: it holds the driver's seat"):
        copy.deepcopy(environment)
    with pytest.raises(TypeError, match="cannot be copied or pickled: it holds the driver's seat"):
        pickle.dumps(environment)
    with pytest.raises(ValueError, match="a running system places its robots itself"):
        environment.reset(options={"pose": (5, 5, 0)})
    environment.reset(seed=1)
    other = make(world)
    other.reset(seed=2)
    with pytest.raises(Error, match="holds the seat now"):
        environment.step(0)
    environment.reset(seed=3)
    environment.step(0)
    environment.close()
    other.close()
    for late in (lambda: environment.unwrapped.step(0), environment.reset, lambda: environment.reset(seed=1)):
        with pytest.raises(ClosedEnvironmentError, match="closed"):
            late()
    environment.close()


def test_any_seed_begins_the_same_run_here_and_there(system, world):
    here, there = gymnasium.make(NAME, percept="sensors"), make(world, percept="sensors")
    for seed in (2**53, 2**63 + 5, 2**100):
        np.testing.assert_array_equal(here.reset(seed=seed)[0], there.reset(seed=seed)[0])
        np.testing.assert_array_equal(here.reset()[0], there.reset()[0])
    first, _ = make(world, percept="sensors").reset()
    assert here.observation_space.contains(first)
    there.close()


def test_what_other_people_do_with_the_world_is_said(system, world):
    environment = gymnasium.make(NAME, connect="local", world=world, timeout=1.0)
    environment.reset(seed=5)
    assert phototaxis("control", "pause", "--name", world).returncode == 0
    with pytest.raises(Error, match=f"it is paused; to continue: phototaxis control resume --name {world}"):
        environment.step(4)
    assert phototaxis("control", "resume", "--name", world).returncode == 0
    environment.step(4)
    assert phototaxis("control", "begin", "--seed", 9, "--name", world).returncode == 0
    with pytest.raises(Error, match=r"somebody else has begun a new run .* reset\(\) goes on in it"):
        environment.step(4)
    environment.reset()
    assert environment.step(4)[4]["episode_number"] == 1
    silent = gymnasium.make(NAME, connect="local", world=world, timeout=1.0)
    with pytest.raises(Error, match=r"gymnasium-\w+ holds the seat and has not answered for \d"):
        silent.reset(seed=1)  # the first one sits there and does nothing
    environment.close()
    silent.close()


def test_a_finished_run_is_said(start, world):
    system = start("sim", "--name", world, "--epochs", 3), start("sensors", "--name", world)
    with observer(world) as bus:
        wait_alive(bus, "sensors", *system)
    environment = gymnasium.make(NAME, connect="local", world=world, timeout=1.5)
    environment.reset(seed=1)
    for _ in range(3):
        environment.step(4)
    with pytest.raises(Error, match=r"its run is finished; reset\(seed=…\) begins another"):
        environment.step(4)
    environment.reset(seed=2)
    environment.step(4)
    environment.close()


def test_nobody_there(world):
    with pytest.raises(Error, match=f"no simulation answers in the world '{world}'"):
        gymnasium.make(NAME, connect="local", world=world, timeout=0.3)
    with pytest.raises(Error, match="the bus cannot be opened"):
        gymnasium.make(NAME, connect="tcp/127.0.0.1:1", timeout=0.3)


@pytest.mark.parametrize("name", ["zenoh.json5", "zenoh.json", "zenoh.yaml", "zenoh.yml"])
def test_every_form_of_zenohs_files_is_known(name, world, tmp_path, monkeypatch):
    file = tmp_path / name
    file.write_text('{"mode": "client"}')
    with pytest.raises(Error, match=f"{name}: names no endpoint"):
        gymnasium.make(NAME, connect=str(file), world=world)
    file.write_text('{"mode": "peer", "listen": {"endpoints": ["tcp/127.0.0.1:0"]}}')
    monkeypatch.setenv("ZENOH_CONFIG", str(file))
    with pytest.raises(Error, match=f"in the world '{world}' through .*{name}; start one"):
        gymnasium.make(NAME, connect="local", world=world, timeout=0.1)


@pytest.mark.parametrize("role", ["sim", "sensors"])
def test_a_killed_component_is_an_error_and_no_hang(system, world, role):
    environment = gymnasium.make(NAME, connect="local", world=world, timeout=1.5)
    environment.reset(seed=1)
    system[role].kill()
    with pytest.raises(Error, match=f"{role} not on the bus"):
        walk(environment, 100, 1)
    environment.close()


def test_killed_sensors_that_come_back_are_not_noticed(system, world, start):
    here, there = gymnasium.make(NAME, percept="sensors"), make(world, percept="sensors")
    expected = walk(here, 600, 2)
    found: list[tuple] = []
    walker = threading.Thread(target=lambda: found.extend(walk(there, 600, 2)))
    walker.start()
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 100, system["sim"])
        system["sensors"].kill()
        system["sensors"] = start("sensors", "--name", world)
    walker.join()
    for one, other in zip(expected, found, strict=True):
        np.testing.assert_array_equal(one[1], other[1])
    there.close()


def test_a_killed_simulation_continues_the_run_that_was_begun(start, world, tmp_path):
    words = ["sim", "--name", world, "--run", "r", "--seed", 9, "--journal", tmp_path / "sim.journal"]
    sim, sensors = start(*words), start("sensors", "--name", world)
    expected, found = walk(gymnasium.make(NAME, percept="sensors"), 600, 2), list[tuple]()
    there = make(world, percept="sensors")
    walker = threading.Thread(target=lambda: found.extend(walk(there, 600, 2)))
    walker.start()
    with observer(world) as bus:
        wait_status(bus, lambda status: status.run.startswith("r.") and status.tick > 100, sim, sensors)
        sim.kill()
        sim = start(*words)
    walker.join()
    for one, other in zip(expected, found, strict=True):
        np.testing.assert_array_equal(one[1], other[1])
    there.close()


def test_a_simulation_killed_after_it_obeyed_is_not_driven_twice(start, world, tmp_path):
    """It comes back with nobody on the seat, and with the motors of the command whose readings never came."""
    words = ["sim", "--name", world, "--run", "r", "--seed", 9, "--journal", tmp_path / "sim.journal"]
    sim, sensors = start(*words), start("sensors", "--name", world)
    here, there = gymnasium.make(NAME, percept="sensors"), make(world, percept="sensors")
    np.testing.assert_array_equal(here.reset(seed=4)[0], there.reset(seed=4)[0])
    for environment in (here, there):
        environment.step(7)
    sensors.popen.send_signal(signal.SIGSTOP)
    answers: list[tuple] = []
    stepping = threading.Thread(target=lambda: answers.extend(there.step(action) for action in (5, 4, 8)))
    stepping.start()
    with observer(world) as bus:
        wait_status(bus, lambda status: status.run.startswith("r.") and status.tick == 2, sim)
    sim.kill()
    sensors.kill()
    sim, sensors = start(*words), start("sensors", "--name", world)
    stepping.join()
    for action, answer in zip((5, 4, 8), answers, strict=True):
        expected = here.step(action)
        np.testing.assert_array_equal(expected[0], answer[0])
        assert (expected[1:4], expected[4]["tick"]) == (answer[1:4], answer[4]["tick"])
    there.close()


def test_a_program_that_forgets_to_close_ends_and_frees_the_seat(system, world):
    script = (
        f"import gymnasium; e = gymnasium.make({NAME!r}, connect='local', world={world!r}); e.reset(seed=1); e.step(4)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    with observer(world) as bus:
        wait_status(bus, lambda status: not status.driver, system["sim"])


def test_an_agent_that_took_over_once_does_not_take_the_seat_back(system, world, start):
    """As all agents in containers are, and all that `phototaxis swap` brings."""
    agent = start("agent", "--name", world, "--take-over")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.driver.startswith("qtable-"), agent)
        environment = make(world)
        for seed in (1, 2):
            environment.reset(seed=seed)
            for _ in range(100):
                environment.step(4)
        environment.close()
        wait_status(bus, lambda status: status.driver.startswith("qtable-"), agent)


def test_in_real_time_a_step_shows_what_its_action_did(start, world):
    """However long a learner takes: what came meanwhile is passed over, an answer that was late is given again."""
    system = start("sim", "--name", world, "--speed", 20), start("sensors", "--name", world)
    with observer(world) as bus:
        wait_alive(bus, "sensors", *system)
        environment = make(world, action="continuous", percept="sensors")
        environment.reset(seed=1)
        place: Any = environment.unwrapped
        for motors in ((0.25, -0.25), (-0.25, 0.25), (0.5, 0.25)):
            before = place.step(np.array(motors, np.float32))[4]["tick"]
            pause = wait_status(bus, lambda status, before=before: status.tick > before + 20, *system)
            _, _, _, _, info = environment.step(np.array([1.0, motors[0]], np.float32))
            assert info["tick"] > pause.tick, "not one of those that were waiting"
            assert (place._episode.now.left, place._episode.now.right) == (1.0, motors[0])
        number = info["episode_number"]
        wait_status(bus, lambda status: status.tick > info["tick"] + 20, *system)
        _, info = environment.reset()
        assert info["episode_number"] == number + 1
        environment.close()


@pytest.mark.parametrize("options", [{"percept": "x"}, {"reward": "x"}, {"action": "x"}])
def test_a_wrong_option_is_said_before_the_bus_is_entered(options: dict[str, Any]):
    line = r"no percept|no reward|no actions"
    with pytest.raises(Error, match=line):
        gymnasium.make(NAME, connect="tcp/127.0.0.1:1", **options)
    with pytest.raises(Error, match=line):
        gymnasium.make_vec(NAME, num_envs=2, connect="tcp/127.0.0.1:1", **options)
