"""Runs on disks that take no more: they go on, say so, end with exit code 3, and continue only what was kept."""

import json
import signal
import subprocess
from pathlib import Path

import msgspec
import pytest
from phototaxis.runtime.errors import Unavailable
from phototaxis.runtime.journal import GIVEN_UP, Journal
from phototaxis_launcher.child import Child
from phototaxis_sim import arenas
from phototaxis_sim.simulation import Simulation
from rerun_files import newest_tick
from support import command, observer, phototaxis, wait_alive, wait_status


def limited(kilobytes: int, *words: object) -> list[str]:
    """A command that cannot write files larger than that, nor can what it starts."""
    return ["sh", "-c", f'ulimit -f {2 * kilobytes}; exec "$@"', "sh", *command(*words)]


def test_a_run_on_a_full_disk_is_the_same_run(start, world, tmp_path):
    words = ("--epochs", 1500, "--seed", 7, "--json")
    place = ("--name", world, "--out", tmp_path, "--grpc-port", 0, "--web-port", -1)
    launcher = start("up", argv=limited(250, "up", *place, *words))
    assert launcher.end() == 3
    found = json.loads(launcher.stdout)
    alone = json.loads(phototaxis("train", *words).stdout)
    for name in ("state_hash", "learner_hash", "reached"):
        assert found[name] == alone[name]
    file, told = Path(found["recording"]), f"{found['recording']}: File too large; "
    assert found["warnings"][0].startswith(told)
    assert f"phototaxis: warning: {told}" in launcher.stderr
    assert launcher.stderr.splitlines()[-1].startswith(f"phototaxis: error: recorder: {told}")
    assert newest_tick(file) == json.loads(file.with_suffix(".json").read_text())["tick"] < found["ticks"]
    assert "checkpoint.journal: File too large; if it dies now" in (file.parent / "agent.log").read_text()
    assert not list(file.parent.glob("*.new"))


def test_a_recorder_that_stopped_says_so_while_the_run_goes_on(start, world, tmp_path):
    place = ("--name", world)
    recorder = start(
        "recorder",
        argv=limited(250, "recorder", *place, "--output", tmp_path / "r.rrd", "--grpc-port", 0, "--web-port", -1),
    )
    others = [start("sim", *place), start("sensors", *place)]
    with observer(world) as bus:
        wait_alive(bus, "recorder", recorder, *others)
        others.append(start("agent", *place))
        status = wait_status(bus, lambda status: bool(status.warnings), recorder, *others)
        wait_status(bus, lambda later: later.tick > status.tick + 100, recorder, *others)
    assert status.warnings[0].startswith(f"{tmp_path / 'r.rrd'}: File too large; ")
    assert status.warnings[0] in phototaxis("status", *place).stdout
    assert recorder.stop() == 3
    assert recorder.stderr.splitlines()[-1] == f"phototaxis: error: {status.warnings[0]}"
    assert newest_tick(tmp_path / "r.rrd") == json.loads((tmp_path / "r.json").read_text())["tick"]


def test_an_agent_that_cannot_save_ends_with_a_line_and_its_older_checkpoint(start, world, tmp_path):
    place, kept = ("--name", world), tmp_path / "a" / "c.npz"
    kept.parent.mkdir()
    others = [start("sim", *place, "--epochs", 0), start("sensors", *place)]
    agent = start("agent", *place, "--checkpoint", kept)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 20, agent, *others)
    kept.parent.rename(tmp_path / "elsewhere")
    assert agent.stop() == 3
    assert agent.stderr.splitlines()[-1] == f"phototaxis: error: {kept}: No such file or directory"


@pytest.mark.parametrize("role", ["sim", "agent"])
def test_what_was_not_kept_is_not_continued(start, world, tmp_path, role):
    place, journal = ("--name", world, "--run", "r"), Journal(tmp_path / "c.journal")
    if role == "sim":
        simulation = Simulation(arenas.load("paper"), 0, "r", 100)
        journal.begin(msgspec.msgpack.encode(simulation.snapshot([], "")))
        journal.give_up()
        done = start("sim", *place, "--journal", journal.path)
    else:
        others = [start("sim", *place), start("sensors", "--name", world)]
        first = start("agent", "--name", world, "--checkpoint", tmp_path / "c.npz")
        with observer(world) as bus:
            wait_status(bus, lambda status: status.tick > 20, first, *others)
        first.popen.send_signal(signal.SIGKILL)
        first.end()
        journal.resume(journal.read())
        journal.give_up()
        assert GIVEN_UP in journal.read()
        done = start("agent", "--name", world, "--checkpoint", tmp_path / "c.npz", "--restarted")
    assert done.end() == 3
    assert done.stderr.splitlines()[-1].startswith(
        f"phototaxis: error: {journal.path}: could not be written to its end"
    )


@pytest.mark.parametrize(
    "words",
    [
        "sim --journal {}",
        "agent --checkpoint {}",
        "recorder --output {}",
        "train --checkpoint {}",
        "up --out {}",
        "experiment --out {}",
        "reproduce --out {}",
        "reproduce --results {}",
        "certs --out {}",
        "fmu build light --sources-only --output {}",
        "view nothing --picture {}.png",
        "check wire --write --file {}",
    ],
)
def test_every_place_is_tried_before_the_work_begins(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    done = phototaxis(*words.format("/dev/null/x").split())
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("phototaxis: error: --")
    assert "/dev/null" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir()), "nothing is left where nothing began"


def test_a_full_log_changes_no_exit_code():
    for words in (("sim", "--journal", "nowhere/j"), ("train", "--checkpoint", "nowhere/c.npz")):
        with Path("/dev/full").open("w") as full:
            assert subprocess.run(command(*words), stderr=full, check=False).returncode == 2


def test_a_component_whose_log_is_gone_is_told_with_the_reason(tmp_path, monkeypatch):
    (tmp_path / "full.py").write_text("import shutil; shutil.rmtree('logs'); raise SystemExit(3)")
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    child = Child("full", "full", [], Path("logs"))
    child.start()
    assert child.process is not None
    child.process.wait()
    with pytest.raises(Unavailable, match=r"full: exit code 3; its log logs/full\.log: there is no folder logs"):
        child.watch()
    child.stop(1.0)
