"""Agents of others: one imports nothing of this project, one is a plug-in, one breaks the rules."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.ports import free_ports
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.messages import Command, Control, Readings
from support import Process, observer, phototaxis, wait_status

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def router(start):
    """A router of ours on a free loopback port; its endpoint."""
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    process: Process = start("router", "--listen", endpoint)
    deadline = time.monotonic() + 20
    while "is up" not in process.stderr:
        process.alive()
        assert time.monotonic() < deadline
    return endpoint


def test_the_foreign_example_imports_nothing_of_ours():
    text = (EXAMPLES / "foreign_agent.py").read_text()
    assert "import phototaxis" not in text
    assert "from phototaxis" not in text
    body = text.split('"""', 2)[2]
    assert len([line for line in body.splitlines() if line.strip()]) <= 40


def test_the_foreign_example_drives_to_the_light_and_keeps_the_contract(start, world, router):
    place = ("--name", world, "--connect", router)
    foreign = [sys.executable, str(EXAMPLES / "foreign_agent.py"), router, world]
    trial = start("check", "agent", *place)
    guest = start("foreign", argv=foreign)
    assert trial.end() == 0, trial.stdout + trial.stderr + guest.stderr
    assert trial.stdout.count("pass") == len(trial.stdout.splitlines()) == 8
    guest.kill()
    sim, sensors = start("sim", *place), start("sensors", *place)
    guest = start("foreign", argv=foreign)
    options = BusOptions(name=world, connect=[router])
    with open_session("observer", options) as session, Bus(session, world, "observer", "test") as bus:
        status = wait_status(bus, lambda status: status.reached >= 5, sim, sensors, guest)
        assert status.driver == "chaser"
        assert bus.control(Control(verb="begin", seed=5), timeout=20)
        wait_status(bus, lambda now: now.run != status.run and now.reached >= 2, sim, sensors, guest)


def test_our_own_agent_keeps_the_contract(start, world):
    trial = start("check", "agent", "--name", world)
    agent = start("agent", "--name", world)
    assert trial.end() == 0, trial.stdout + trial.stderr + agent.stderr
    assert "FAIL" not in trial.stdout


def test_an_agent_that_breaks_the_contract_is_told_where(start, world):
    """It answers twice, with other motors the second time, never ends an episode, and does not step down."""
    trial = start("check", "agent", "--name", world, "--ticks", 20)
    with observer(world) as watch:
        watch.wait_for("sim", 20)
    options = BusOptions(name=world)
    with open_session("agent", options, "rude") as session, Bus(session, world, "agent", "rude") as bus:
        spin = 0.0
        while trial.popen.poll() is None:
            event = bus.receive(timeout=0.05)
            if event is None or event.topic != "readings":
                continue
            readings: Readings = event.message
            if not readings.driver:
                bus.control(Control(verb="claim", agent="rude"))
                continue
            spin = 1.0 - spin
            bus.put("command", Command(run=readings.run, tick=readings.tick, author="rude", left=spin, right=0.0))
    assert trial.end() == 4
    failed = [line for line in trial.stdout.splitlines() if line.startswith("FAIL")]
    assert [line.split(":")[0] for line in failed] == [
        "FAIL  repeats its answer, byte for byte, when a tick is asked again",
        "FAIL  ends the episode when it has reached the light",
        "FAIL  keeps silent about an older tick",
        "FAIL  steps down when another one drives",
    ]
    assert "breaks 4 clauses" in trial.stderr


def test_without_an_agent_the_check_says_so(world):
    done = phototaxis("check", "agent", "--name", world, "--agent-timeout", 0.2)
    assert done.returncode == 3
    assert "liveliness token" in done.stderr


def test_while_a_run_is_up_the_check_says_how(start, world):
    simulation = start("sim", "--name", world)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.run != "", simulation)
    done = phototaxis("check", "agent", "--name", world)
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1
    assert "give it and the agent a world of their own: --name trial" in done.stderr


def test_a_learner_of_ones_own_plugs_in_by_its_entry_point(tmp_path):
    """Built and installed as its users would, beside the project."""
    target = tmp_path / "site"
    built = subprocess.run(
        [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--target", target,
         EXAMPLES / "double_q"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    script = (
        f"import sys; sys.path.insert(0, {str(target)!r}); import double_q; print(double_q.__file__, file=sys.stderr); "
        "from phototaxis_launcher.cli import main; main()"
    )
    words = ("train", "--learner", "double-q", "--epochs", "3000", "--seed", "3", "--json")
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["learner"] == "double-q"
    assert str(target) in done.stderr


def test_one_process_drives_two_arenas_on_one_bus(start, router, tmp_path):
    worlds = {"left": 3, "right": 4}
    places = {name: ("--name", name, "--connect", router) for name in worlds}
    for name, seed in worlds.items():
        start("sim", *places[name], "--epochs", 600, "--seed", seed)
        start("sensors", *places[name])
    agent = start("agent", "--worlds", ",".join(worlds), "--connect", router, "--checkpoint", tmp_path)
    for name, seed in worlds.items():
        options = BusOptions(name=name, connect=[router])
        with open_session("observer", options) as session, Bus(session, name, "observer", "test") as bus:
            status = wait_status(bus, lambda status: status.phase == "finished", agent)
        alone = json.loads(phototaxis("train", "--epochs", 600, "--seed", seed, "--json").stdout)
        assert status.hash == alone["state_hash"]
        assert load(tmp_path / f"{name}.npz")[0].learner_hash == alone["learner_hash"]
    assert agent.stop() == 0


def test_two_arenas_with_an_agent_each_do_not_disturb_each_other(start, router, tmp_path):
    for name, seed in {"left": 3, "right": 4}.items():
        place = ("--name", name, "--connect", router)
        start("sim", *place, "--epochs", 400, "--seed", seed)
        start("sensors", *place)
        start("agent", *place, "--checkpoint", tmp_path / f"{name}.npz")
    for name, seed in {"left": 3, "right": 4}.items():
        options = BusOptions(name=name, connect=[router])
        with open_session("observer", options) as session, Bus(session, name, "observer", "test") as bus:
            status = wait_status(bus, lambda status: status.phase == "finished")
        assert len([who for who in status.alive if who.startswith("agent/")]) == 1
        assert (
            status.hash
            == json.loads(phototaxis("train", "--epochs", 400, "--seed", seed, "--json").stdout)["state_hash"]
        )
