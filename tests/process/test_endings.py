"""How commands end: at one tick, with the exit code of the README, and leaving nothing behind."""

import json
import os
import pty
import select
import signal
import socket
import subprocess
from http.client import HTTPConnection
from pathlib import Path

import psutil
import pytest
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.ports import free_ports
from support import DEADLINE, command, observer, phototaxis, result, wait_status


@pytest.mark.parametrize("way", ["Ctrl-C", "SIGTERM", "stop"])
def test_a_run_that_is_stopped_ends_at_one_tick(up, world, way):
    launcher = up("--epochs", 0, "--seed", 7)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 100, launcher)
        if way == "stop":
            assert phototaxis("control", "stop", "--name", world).returncode == 0
        else:
            launcher.popen.send_signal(signal.SIGINT if way == "Ctrl-C" else signal.SIGTERM)
    found = result(launcher, 130 if way == "Ctrl-C" else 0)
    meta = load(Path(found["checkpoint"]))[0]
    summary = json.loads(Path(found["recording"]).with_suffix(".json").read_text())
    assert not found["finished"]
    assert found["ticks"] == meta.tick == summary["tick"]
    assert found["learner_hash"] == meta.learner_hash


def test_the_result_is_of_whoever_drove_last(start, up, world, tmp_path):
    """An agent from elsewhere took the seat: what the launcher's own one had learned is not the run's result."""
    launcher = up("--epochs", 0, "--seed", 7, "--no-recorder")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 10, launcher)
        start("agent", "--name", world, "--take-over", "--checkpoint", tmp_path / "theirs.npz", "--label", "theirs")
        wait_status(bus, lambda status: "theirs" in status.driver, launcher)
    launcher.popen.terminate()
    found = result(launcher)
    assert [found[key] for key in ("learner", "learner_hash", "checkpoint")] == [None, None, None]
    assert [one["checkpoint"] is None for one in found["drivers"]] == [False, True]


def test_ctrl_c_is_130_for_every_component_and_nothing_stays(start, world, tmp_path):
    grpc, web, port = free_ports(3)
    place = "--name", world
    recorder = start("recorder", *place, "--output", tmp_path, "--grpc-port", grpc, "--web-port", web)
    parts = [
        start("sim", *place),
        start("sensors", *place),
        start("agent", *place, "--checkpoint", tmp_path / "c.npz"),
        recorder,
    ]
    router = start("router", "--listen", f"tcp/127.0.0.1:{port}")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 10 and "recorder" in "".join(status.alive), *parts)
    browser = HTTPConnection("127.0.0.1", web, timeout=DEADLINE)
    browser.request("GET", "/")
    page = browser.getresponse()
    assert f"connect-src 'self' data: blob: http://localhost:{grpc} " in page.headers["Content-Security-Policy"]
    html = page.read()
    assert b"Rerun Viewer" in html
    assert b'href="https://' not in html, "a hint to connect to others"
    helpers = psutil.Process(recorder.popen.pid).children(recursive=True)
    while "is up" not in router.stderr:
        router.alive()
    for part in [recorder, router, *parts[:3]]:
        part.popen.send_signal(signal.SIGINT)
        for helper in helpers if part is recorder else []:  # a terminal's Ctrl-C reaches them all
            helper.send_signal(signal.SIGINT)
        assert part.end() == 130, part.stderr
        assert "Traceback" not in part.stderr
    with socket.create_server(("127.0.0.1", web)), socket.create_server(("127.0.0.1", grpc)):
        assert not psutil.wait_procs(helpers, timeout=20)[1]


class Terminal:
    """A command in a pseudo-terminal, which is read until what is waited for appears."""

    def __init__(self, *words: object):
        self._tty, theirs = pty.openpty()
        self._popen = subprocess.Popen(
            command(*words), stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True
        )
        os.close(theirs)
        self.shown = ""

    def _read(self) -> str:
        """What is shown next; "" at the end."""
        assert select.select([self._tty], [], [], DEADLINE)[0], f"nothing more after:\n{self.shown}"
        try:
            text = os.read(self._tty, 4096).decode(errors="replace")
        except OSError:  # a terminal's way to say that the last process has left it
            text = ""
        self.shown += text
        return text

    def read_until(self, wanted: str) -> None:
        while wanted not in self.shown:
            assert self._read(), f"no {wanted!r} in:\n{self.shown}"

    def interrupt(self) -> int:
        """What Ctrl-C does, to the whole group of processes; the exit code."""
        os.killpg(self._popen.pid, signal.SIGINT)
        while self._read():
            pass
        os.close(self._tty)
        return self._popen.wait(DEADLINE)


def test_a_demo_in_a_terminal_can_be_watched_until_ctrl_c(world, tmp_path):
    grpc, web = free_ports(2)
    words = "--name", world, "--out", tmp_path, "--epochs", 12, "--seed", 7, "--grpc-port", grpc, "--web-port", web
    terminal = Terminal("demo", *words)
    terminal.read_until("What you see")
    terminal.read_until("Ctrl-C ends")
    with socket.create_connection(("127.0.0.1", grpc)), socket.create_connection(("127.0.0.1", web)):
        pass
    assert terminal.interrupt() == 130
    assert "look again: " in terminal.shown
    assert "the paper" not in terminal.shown.lower(), "its 80% are those of 3,000 epochs"
    alone = json.loads(phototaxis("train", "--epochs", 12, "--seed", 7, "--json").stdout)
    (checkpoint,) = tmp_path.glob("*/checkpoint.npz")
    assert load(checkpoint)[0].learner_hash == alone["learner_hash"], "a slow beginning and end change nothing"


def test_a_demo_without_a_terminal_ends_by_itself(start, world, tmp_path):
    words = "--name", world, "--out", tmp_path, "--grpc-port", 0, "--web-port", -1, "--seed", 7, "--json"
    found = result(start("demo", *words, "--epochs", 300))
    assert found["finished"]
    assert 0 <= found["evaluation"]["success_rate"] <= 1
    assert Path(found["recording"]).is_file()


@pytest.mark.parametrize("words", ["--help", "recordings --out runs", "juggle"])
def test_a_reader_that_has_gone_is_no_error(tmp_path, monkeypatch, words):
    """As in `phototaxis recordings | head -1`."""
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "a.rrd").touch()
    monkeypatch.chdir(tmp_path)
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(command(*words.split()), stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr.count("\n")) == ((2, 1) if words == "juggle" else (141, 0)), done.stderr
    with open("/dev/full", "w") as full:
        done = subprocess.run(command("--help"), stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 3
    assert done.stderr.startswith("phototaxis: error: the output cannot be written: ")


def test_a_terminal_without_the_character_gets_another(monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    done = phototaxis("train", "--help")
    assert done.returncode == 0, done.stderr
    assert "learning rate ?" in done.stdout
