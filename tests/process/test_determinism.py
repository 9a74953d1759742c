"""Same seeds, same trajectory: in one process, over the bus, and through every accident."""

import json
import os
import signal
import sys
from pathlib import Path

import pytest
from making import own_learners
from support import children, observer, phototaxis, result, wait_status

EPOCHS = 3000
HASHES = ("state_hash", "learner_hash")


@pytest.fixture(scope="session")
def alone() -> dict[str, str]:
    """The hashes of the same run in one process."""
    done = phototaxis("train", "--epochs", EPOCHS, "--seed", 7, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    return {name: found[name] for name in HASHES}


def hashes(found: dict[str, str]) -> dict[str, str]:
    return {name: found[name] for name in HASHES}


def test_the_bus_changes_nothing(up, alone):
    for _ in range(2):
        found = result(up("--epochs", EPOCHS, "--seed", 7))
        assert found["finished"]
        assert found["epochs"] == EPOCHS
        assert found["episodes"] >= found["reached"] > 0
        assert found["ticks"] == EPOCHS + found["episodes"]
        assert Path(found["recording"]).stat().st_size > 100_000
        assert Path(found["checkpoint"]).exists()
        assert hashes(found) == alone
    other = phototaxis("train", "--epochs", EPOCHS, "--seed", 8, "--json")
    assert hashes(json.loads(other.stdout)) != alone


def test_the_rich_percept_too(up):
    words = ("--epochs", 1500, "--seed", 3, "--percept", "rich", "--arena", "shadows")
    done = phototaxis("train", *words, "--json")
    assert hashes(result(up(*words, "--no-recorder"))) == hashes(json.loads(done.stdout))


@pytest.mark.parametrize(
    ("victims", "number"),
    [
        (["sensors", "recorder"], signal.SIGKILL),
        (["sensors", "recorder"], signal.SIGTERM),
        (["agent"], signal.SIGKILL),
        (["sim"], signal.SIGKILL),
        (["agent", "sim"], signal.SIGKILL),
    ],
)
def test_killed_components_are_restarted_and_change_nothing(up, alone, world, victims, number):
    launcher = up("--epochs", EPOCHS, "--seed", 7)
    with observer(world) as bus:
        for count, victim in enumerate(victims, 1):
            wait_status(bus, lambda status, count=count: status.epoch > 500 * count, launcher)
            os.kill(children(launcher.popen.pid)[victim], number)
    found = result(launcher)
    assert found["restarts"] == dict.fromkeys(victims, 1)
    assert hashes(found) == alone


def test_lost_and_doubled_messages_change_nothing(start, alone, world, tmp_path):
    checkpoint = tmp_path / "c.npz"
    share, lossy = "0.02", str(Path(__file__).with_name("lossy.py"))

    def unreliable(role: str, *words: str):
        return start(role, argv=[sys.executable, lossy, f"phototaxis_{role}", share, "--name", world, *words])

    sim = unreliable("sim", "--epochs", str(EPOCHS), "--seed", "7")
    sensors = unreliable("sensors")
    with observer(world) as bus:
        agent = unreliable("agent", "--checkpoint", str(checkpoint))
        status = wait_status(bus, lambda status: status.phase == "finished", sim, sensors, agent)
    agent.stop()
    assert status.refused["command: late or repeated"] > 10  # doubled and repeated answers did arrive
    found = json.loads(phototaxis("evaluate", checkpoint, "--placements", 20, "--json").stdout)
    assert found["placements"] == 20
    from phototaxis.runtime.checkpoint import load

    assert {"state_hash": status.hash, "learner_hash": load(checkpoint)[0].learner_hash} == alone


@pytest.mark.parametrize("learner", [name for name in own_learners() if name != "qtable"])
def test_every_learner_learns_the_same_over_the_bus(up, learner):
    percept = "continuous" if learner == "dqn" else "rich" if learner == "mirror" else "simple"
    words = ("--learner", learner, "--percept", percept, "--epochs", 500, "--seed", 5)
    done = phototaxis("train", *words, "--json")
    assert done.returncode == 0, done.stderr
    assert hashes(result(up(*words, "--no-recorder"))) == hashes(json.loads(done.stdout))


def test_a_killed_net_continues_with_its_memory_and_its_optimiser(up, world):
    words = ("--learner", "dqn", "--percept", "continuous", "--epochs", 800, "--seed", 5)
    launcher = up(*words)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.epoch > 300, launcher)
        os.kill(children(launcher.popen.pid)["agent"], signal.SIGKILL)
    found = result(launcher)
    assert found["restarts"] == {"agent": 1}
    assert hashes(found) == hashes(json.loads(phototaxis("train", *words, "--json").stdout))
