"""`phototaxis up` as its user meets it: status, control, endings, bad input."""

import json
import os
import signal
import socket
import subprocess
import sys

import msgspec
import psutil
import pytest
from phototaxis.runtime.ports import free_ports
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.codec import Decoder
from phototaxis.wire.messages import Command, Control, State
from phototaxis_launcher.cli import VERBS
from support import children, observer, phototaxis, result, wait_status


def test_status_and_control_from_a_second_terminal(up, world, tmp_path):
    launcher = up("--epochs", 0, "--no-recorder")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 10, launcher)
        found = json.loads(phototaxis("status", "--name", world, "--json").stdout)
        assert found["phase"] == "running"
        assert found["driver"].startswith("qtable-")
        assert {who.split("/")[0] for who in found["alive"]} >= {"sim", "sensors", "agent"}
        words = phototaxis("status", "--name", world).stdout
        assert "running" in words
        assert "qtable-" in words

        assert phototaxis("control", "pause", "--name", world).returncode == 0
        tick = wait_status(bus, lambda status: status.phase == "paused", launcher).tick
        assert phototaxis("control", "step", "--name", world).returncode == 0
        assert wait_status(bus, lambda status: status.tick > tick, launcher).tick == tick + 1
        episode = wait_status(bus, lambda status: True, launcher).episode
        assert phototaxis("control", "reset", "--name", world).returncode == 0
        wait_status(bus, lambda status: status.episode == episode + 1, launcher)
        assert phototaxis("control", "speed", "--speed", 10, "--name", world).returncode == 0
        assert phototaxis("control", "resume", "--name", world).returncode == 0
        wait_status(bus, lambda status: status.speed == 10 and 0 < status.rate < 40, launcher)
        assert "paused simulation" in phototaxis("control", "step", "--name", world).stderr
        again = phototaxis("up", "--name", world, "--no-recorder", "--out", tmp_path)
        assert again.returncode == 3
        assert f"already running in the world '{world}'" in again.stderr
    launcher.popen.send_signal(signal.SIGINT)
    found = result(launcher, 130)
    assert not found["finished"]
    assert not children(launcher.popen.pid)


def test_real_time_keeps_the_pace_and_a_frozen_agent_comes_back(up, world):
    launcher = up("--epochs", 0, "--no-recorder", "--speed", 20)
    states: list[State] = []
    decode = Decoder(State, 4096)
    with observer(world) as bus, open_session("observer", BusOptions(name=world)) as reader:
        reader.declare_subscriber(f"{world}/state", lambda sample: states.append(decode(sample.payload.to_bytes())))
        wait_status(bus, lambda status: status.tick > 20 and 30 < status.rate < 50, launcher)
        agent = children(launcher.popen.pid)["agent"]
        os.kill(agent, signal.SIGSTOP)
        wait_status(bus, lambda status: status.phase == "waiting" and "agent" in status.waiting_for, launcher)
        last = max(state.tick for state in states if state.author)
        stopped = next(state for state in states if state.tick == last + 1)
        assert (stopped.left, stopped.right, stopped.author) == (0, 0, "")
        assert stopped.driver  # the motors stopped by the clock, before the seat was lost
        os.kill(agent, signal.SIGCONT)
        frozen = wait_status(bus, lambda status: status.phase == "running", launcher)
        wait_status(bus, lambda status: status.tick > frozen.tick + 20, launcher)


def test_nothing_outlives_a_launcher_that_is_killed(up, world):
    launcher = up("--epochs", 0, "--no-recorder")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 10, launcher)
        components = [psutil.Process(pid) for pid in children(launcher.popen.pid).values()]
        launcher.kill()
    gone, alive = psutil.wait_procs(components, timeout=20)
    assert len(gone) == 3
    assert not alive


def test_intruders_are_refused_counted_and_harmless(up, world):
    launcher = up("--epochs", 0, "--seed", 1, "--no-recorder", "--speed", 10)
    good = {"run": "x", "tick": 0, "author": "intruder", "left": 1.0, "right": 1.0}
    bad = {
        "command: another run": msgspec.msgpack.encode(good),
        "command: schema": msgspec.msgpack.encode({**good, "schema": 99}),
        "command: oversized": msgspec.msgpack.encode({**good, "author": "x" * 5000}),
        "command: malformed": b"\xc1 not MessagePack",
        "command: invalid": msgspec.msgpack.encode({**good, "left": float("nan")}),
    }
    with observer(world) as bus, open_session("observer", BusOptions(name=world)) as intruder:
        status = wait_status(bus, lambda status: status.phase == "running" and status.tick > 5, launcher)
        for payload in bad.values():
            intruder.put(f"{world}/command", payload)
        assert not list(intruder.get(f"{world}/control", payload=b'{"verb": "self-destruct"}', timeout=1))
        stolen = Command(run=status.run, tick=status.tick, author="intruder", left=1.0, right=1.0)
        wait_status(bus, lambda status: {*bad, "control: invalid"} <= set(status.refused), launcher)
        reply = bus.control(Control(verb="claim", agent="intruder"))
        assert reply is not None
        assert not reply.ok
        assert "taken" in reply.reason
        intruder.put(f"{world}/command", msgspec.json.encode(stolen))
        later = wait_status(bus, lambda now: now.tick > status.tick + 5, launcher)
        assert later.driver == status.driver
        assert later.phase == "running"


@pytest.mark.parametrize(
    ("words", "code", "line"),
    [
        (["--arena", "mars"], 2, "no arena 'mars'"),
        (["--learner", "magic"], 2, "no learner 'magic'"),
        (["--epohcs", "5"], 2, "--epohcs"),
        (["--epochs", "many"], 2, "--epochs many"),
        (["--learning-rate", "7"], 2, "--learning-rate 7"),
        (["--resume", "nothing.npz"], 2, "nothing.npz: no such checkpoint"),
        (["--listen", "tcp/127.0.0.1:0"], 2, "--listen"),
    ],
)
def test_bad_input_is_one_line(up, words, code, line):
    process = up("--no-recorder", *words)
    assert process.end() == code
    said = [text for text in process.stderr.splitlines() if text.startswith("phototaxis: error:")]
    assert len(said) == 1
    assert line in said[0]
    assert "Traceback" not in process.stderr


def test_a_bad_arena_file_is_one_line(up, tmp_path):
    file = tmp_path / "a.toml"
    file.write_text('name = "a"\nsize = [5.0, 5.0]\nlihgts = []\n')
    process = up("--no-recorder", "--arena", file)
    assert process.end() == 2
    assert f"{file}: lihgts: unknown key" in process.stderr


def test_a_busy_port_is_one_line(start, world, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        process = start("up", "--name", world, "--out", tmp_path, "--grpc-port", port, "--web-port", -1)
        assert process.end() == 3
    assert f"port {port} on 127.0.0.1 is not free" in process.stderr
    assert "--grpc-port" in process.stderr


def test_two_services_on_one_port_are_one_line(start, world, tmp_path):
    (port,) = free_ports(1)
    ports = "--grpc-port", port, "--web-port", port
    process = start("recorder", "--name", world, "--output", tmp_path / "r.rrd", *ports)
    assert process.end() == 3
    assert f"port {port} on 127.0.0.1 is not free" in process.stderr
    assert "choose another with --web-port" in process.stderr


def test_a_checkpoint_of_another_percept_is_one_line(up, tmp_path):
    file = tmp_path / "rich.npz"
    assert phototaxis("train", "--percept", "rich", "--epochs", 50, "--checkpoint", file).returncode == 0
    process = up("--no-recorder", "--resume", file)
    assert process.end() == 2
    assert "of the percept 'rich', but 'simple' is asked for" in process.stderr


def test_a_learner_goes_on_from_a_checkpoint_in_another_run(up, tmp_path):
    first = result(up("--no-recorder", "--epochs", 300))
    second = result(up("--no-recorder", "--epochs", 300, "--resume", first["checkpoint"]))
    assert second["finished"]
    assert second["learner_hash"] != first["learner_hash"]


def test_a_component_that_keeps_dying_is_given_up_with_its_last_words(tmp_path, monkeypatch):
    from phototaxis.runtime.errors import ComponentFailed
    from phototaxis_launcher.child import Child

    (tmp_path / "broken.py").write_text("import sys; sys.exit('the wheel came off')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    child = Child("broken", "broken", [], tmp_path)
    child.start()
    for _ in range(3):
        assert child.process is not None
        child.process.wait(20)
        assert child.watch()
    assert child.process is not None
    child.process.wait(20)
    with pytest.raises(ComponentFailed, match=r"broken died 4 times, last with exit code 1(.|\n)*the wheel came off"):
        child.watch()
    child.stop(5)
    assert child.restarts == 3


def test_wrong_commands_are_one_line():
    wrong = phototaxis("fly")
    assert wrong.returncode == 2
    assert "no command 'fly'; there are: demo, up, status" in wrong.stderr
    assert phototaxis().stdout.startswith("usage: phototaxis COMMAND")


@pytest.mark.parametrize("verb", VERBS)
def test_the_base_install_helps_with_every_command(verb):
    done = without_extras(verb, "--help")
    assert done.returncode == 0, done.stderr
    assert f"usage: phototaxis {verb}" in done.stdout


@pytest.mark.parametrize(("verb", "package", "extra"), [("sim", "pymunk", "sim"), ("recorder", "rerun", "recorder")])
def test_a_missing_extra_is_named(verb, package, extra):
    done = without_extras(verb)
    assert done.returncode == 2
    assert f"needs the package {package}; install it with: pip install 'phototaxis[{extra}]'" in done.stderr


def without_extras(*words: str) -> subprocess.CompletedProcess[str]:
    """A command where nothing but the base install can be imported."""
    script = (
        "import sys\n"
        "for name in ('pymunk', 'rerun', 'rerun_cli', 'torch', 'tqdm', 'fmpy'): sys.modules[name] = None\n"
        "from phototaxis_launcher.cli import main\n"
        "main()"
    )
    return subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=False)
