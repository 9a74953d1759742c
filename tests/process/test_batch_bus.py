"""Many robots in one world, over the bus: as in one process, one learner for all, bad columns do no harm."""

import copy
import os
import signal
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from fmus import Built
from gymnasium.error import ClosedEnvironmentError, Error, InvalidAction
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.columns import FLAG, pack
from phototaxis.wire.messages import BatchCommand, Control
from phototaxis_sim import arenas
from rerun_files import series
from support import children, observer, phototaxis, result, wait, wait_alive, wait_status

NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"


@pytest.fixture
def system(start, world):
    """Starts a simulation of N robots and their sensors."""

    def begin(robots: int, *words: object) -> dict:
        started = {
            "sim": start("sim", "--name", world, "--robots", robots, *words),
            "sensors": start("sensors", "--name", world),
        }
        with observer(world) as bus:
            wait_alive(bus, "sensors", *started.values())
        return started

    return begin


@pytest.mark.parametrize("robots", [5, 300])
def test_the_vector_environment_is_the_same_here_and_there(system, world, robots):
    system(robots)
    here = gymnasium.make_vec(NAME, num_envs=robots, percept="sensors", max_episode_steps=30)
    there: Any = gymnasium.make_vec(
        NAME, num_envs=robots, percept="sensors", max_episode_steps=30, connect="local", world=world
    )
    rng, ends = np.random.default_rng(0), 0
    for seed in (3, 4):
        np.testing.assert_array_equal(here.reset(seed=seed)[0], there.reset(seed=seed)[0])
        for _ in range(100):
            actions = rng.integers(9, size=robots)
            one, other = here.step(actions), there.step(actions)
            for ours, theirs in zip(one[:4], other[:4], strict=True):
                np.testing.assert_array_equal(ours, theirs)
            np.testing.assert_array_equal(one[4]["episode_number"], other[4]["episode_number"])
            ends += int((one[2] | one[3]).sum())
    assert ends > 2 * robots
    with pytest.raises(InvalidAction):
        there.step(np.full(robots, 9))
    with pytest.raises(Error, match="give reset one number"):
        there.reset(seed=list(range(0, 2 * robots, 2)))
    there.close()


def test_resets_of_some_robots_behind_the_bus(system, world, tmp_path):
    """They take a tick of the running system, in which the others hold still: without noise nobody notices."""
    paper = (Path(arenas.__file__).parent / "arenas/paper.toml").read_text()
    (tmp_path / "quiet.toml").write_text(paper.replace("noise = 0.05", "noise = 0.0"))
    system(4, "--arena", tmp_path / "quiet.toml")
    options = {"num_envs": 4, "percept": "sensors", "max_episode_steps": 20, "autoreset_mode": "SameStep"}
    here = gymnasium.make_vec(NAME, arena=str(tmp_path / "quiet.toml"), **options)
    there: Any = gymnasium.make_vec(NAME, connect="local", world=world, **options)
    mask = {"reset_mask": np.array([False, True, False, True])}
    rng, ends = np.random.default_rng(0), 0
    np.testing.assert_array_equal(here.reset(seed=2**90)[0], there.reset(seed=2**90)[0])
    for step in range(60):
        actions = rng.integers(9, size=4)
        one, other = here.step(actions), there.step(actions)
        for ours, theirs in zip(one[:4], other[:4], strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-4)
        for row in np.flatnonzero(one[2] | one[3]):
            ends += 1
            np.testing.assert_allclose(one[4]["final_obs"][row], other[4]["final_obs"][row], atol=1e-4)
            assert one[4]["final_info"]["is_success"][row] == other[4]["final_info"]["is_success"][row] == one[2][row]
        if step == 30:
            np.testing.assert_allclose(here.reset(options=mask)[0], there.reset(options=mask)[0], atol=1e-4)
            np.testing.assert_allclose(here.reset()[0], there.reset()[0], atol=1e-4)
    assert ends > 8
    with pytest.raises(Error, match="give reset one number, and no reset_mask"):
        there.reset(seed=3, options=mask)
    with pytest.raises(ValueError, match="a running system places its robots itself"):
        there.reset(options={"pose": (5, 5, 0)})
    with pytest.raises(TypeError, match="cannot be copied or pickled"):
        copy.deepcopy(there)
    there.close()
    with pytest.raises(ClosedEnvironmentError):
        there.reset(seed=1)


def test_one_learner_drives_them_all_and_killed_sensors_change_nothing(up, world):
    words = "--robots", 16, "--epochs", 8000, "--seed", 3, "--learner", "qtable"
    whole = result(up(*words))
    assert whole["finished"]
    assert 8000 <= whole["epochs"] < 8016
    assert whole["ticks"] < 700, "sixteen robots learn in each"
    ticks = list(range(whole["ticks"] + 1))
    assert sorted(series(whole["recording"], "/world/trail", "Points2D:positions")) == ticks, "the first is recorded"
    assert sorted(series(whole["recording"], "/plots/reward", "Scalars:scalars")) == ticks
    said = [text[0] for _, text in sorted(series(whole["recording"], "/episodes", "TextLog:text").items())]
    assert any(text.startswith("episode 0: ") for text in said)
    assert len(series(whole["recording"], "/plots/success/rate", "Scalars:scalars")) > 2
    launcher = up(*words, "--no-recorder")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 200, launcher)
        os.kill(children(launcher.popen.pid)["sensors"], signal.SIGKILL)
    found = result(launcher)
    assert found["restarts"] == {"sensors": 1}
    assert (found["state_hash"], found["learner_hash"]) == (whole["state_hash"], whole["learner_hash"])
    measured = phototaxis("evaluate", whole["checkpoint"], "--placements", 100, "--json")
    assert measured.returncode == 0, measured.stderr


def test_a_successor_of_its_kind_knows_what_the_driver_of_many_knew(up, world):
    words = "--robots", 8, "--epochs", 6000, "--seed", 3, "--learner", "qtable", "--no-recorder"
    launcher = up(*words, "--swap", "200:qtable,400:mirror")
    found = result(launcher)
    assert [(one["from_tick"], one["learner"]) for one in found["drivers"]] == [
        (0, "qtable"), (200, "qtable"), (400, "mirror"),
    ]  # fmt: skip
    folder = Path(found["checkpoint"]).parent
    assert "inherited what qtable-" in (folder / "agent-2.log").read_text()
    assert "inherited nothing" in (folder / "agent-3.log").read_text()
    learned = load(Path(found["drivers"][1]["checkpoint"]))[0]
    assert learned.epoch > 3000, "its own learning steps and its predecessor's"


def test_a_standby_is_for_one_robot(system, world, start):
    system(3)
    standby = start("agent", "--name", world, "--standby")
    assert standby.end() == 2
    assert "a standby keeps in step with the driver of one robot; this world has 3" in standby.stderr


def test_a_killed_simulation_of_many_ends_the_run(up, world):
    launcher = up("--robots", 4, "--epochs", 0, "--no-recorder")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 50, launcher)
        os.kill(children(launcher.popen.pid)["sim"], signal.SIGKILL)
    assert launcher.end() == 2
    assert "a simulation of many robots that died is not continued" in launcher.stderr


def test_columns_of_the_wrong_size_are_refused_and_the_run_goes_on(system, world):
    sim = system(3)["sim"]
    options = BusOptions(name=world)
    with open_session("agent", options, "raw") as session, Bus(session, world, "agent", "raw") as bus:
        assert bus.wait_for("sim", 20)
        assert bus.control(Control(verb="claim", agent="raw"), timeout=10)
        now = wait(bus, lambda event: event.topic == "batch/readings" and event.message.driver == "raw", sim).message
        good, none = pack(np.zeros(3)), pack(np.zeros(3), FLAG)
        for left, end in (
            (good[:-1], none), (good + good, none), (pack(np.full(3, np.nan)), none),
            (pack(np.full(3, 1.5)), none), (good, pack(np.full(3, 9), FLAG)), (good, b""),
        ):  # fmt: skip
            bus.put(
                "batch/command", BatchCommand(run=now.run, tick=now.tick, author="raw", left=left, right=good, end=end)
            )
        with observer(world) as watch:
            status = wait_status(watch, lambda status: sum(status.refused.values()) == 6, sim)
        assert status.tick == now.tick
        bus.put(
            "batch/command", BatchCommand(run=now.run, tick=now.tick, author="raw", left=good, right=good, end=none)
        )
        wait(bus, lambda event: event.topic == "batch/readings" and event.message.tick == now.tick + 1, sim)


def test_what_is_for_one_robot_says_so(system, world, start, fmu: Built):
    system(3)
    with pytest.raises(Error, match=r"has 3 robots: use gymnasium\.make_vec"):
        gymnasium.make(NAME, connect="local", world=world)
    with pytest.raises(Error, match="has 3 robots, num_envs is 4; start it with --robots 4"):
        gymnasium.make_vec(NAME, num_envs=4, connect="local", world=world)
    foreign = start("sensors", "--name", f"{world}b", "--light-fmu", fmu("lag", 3))
    start("sim", "--name", f"{world}b", "--robots", 2)
    assert foreign.end() == 2
    assert "an FMU senses for one robot; this world has 2" in foreign.stderr
