"""The recording holds every tick, verifies, and shows what it should."""

import json
import os
import signal
import socket
import subprocess
import urllib.request
from pathlib import Path

from phototaxis.runtime.ports import free_ports
from rerun_files import RERUN, newest_tick, salvaged, series
from support import children, observer, phototaxis, result, wait, wait_alive, wait_status


def test_every_tick_is_in_the_recording(up):
    found = result(up("--epochs", 1500, "--seed", 1))
    file = found["recording"]
    verified = subprocess.run([RERUN, "rrd", "verify", file], capture_output=True, text=True, check=False)
    assert verified.returncode == 0, verified.stderr
    ticks = list(range(found["ticks"] + 1))

    reward = series(file, "/plots/reward", "Scalars:scalars")
    assert sorted(reward) == ticks
    assert {3.0, -2.0} <= {value[0] for value in reward.values()}

    trail = series(file, "/world/trail", "Points2D:positions")
    assert sorted(trail) == ticks
    assert all(0 < x < 10 and 0 < y < 10 for ((x, y),) in trail.values())

    rays = series(file, "/world/robot/sonar", "Arrows2D:vectors")
    assert sorted(rays) == ticks
    assert all(len(vectors) == 16 for vectors in rays.values())

    words = series(file, "/episodes", "TextLog:text")
    assert sum("reached the light" in text[0] for text in words.values()) == found["reached"]
    tables = series(file, "/learner/table", "Tensor:data")
    assert tables


def test_a_restarted_recorder_asks_for_what_it_missed(up, world):
    launcher = up("--epochs", 3000, "--seed", 1)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.epoch > 500, launcher)
        os.kill(children(launcher.popen.pid)["recorder"], signal.SIGKILL)
    found = result(launcher)
    assert found["restarts"] == {"recorder": 1}
    assert Path(found["recording"]).name == "recording-2.rrd"
    ticks = list(range(found["ticks"] + 1))
    assert sorted(series(found["recording"], "/plots/reward", "Scalars:scalars")) == ticks
    assert sorted(series(found["recording"], "/world/trail", "Points2D:positions")) == ticks


def test_the_viewers_page_lives_and_dies_with_the_recorder(start, world, tmp_path):
    (port,) = free_ports(1)
    words = ("up", "--name", world, "--out", tmp_path, "--epochs", 0, "--speed", 20, "--json")
    launcher = start(*words, "--grpc-port", 0, "--web-port", port)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 5, launcher)
        assert f"http://localhost:{port}/?url=rerun%2Bhttp" in launcher.stderr
        page = urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=10)
        assert b"rerun" in page.read().lower()
        os.kill(children(launcher.popen.pid)["recorder"], signal.SIGKILL)
        back = wait_status(bus, lambda status: not any("recorder" in who for who in status.alive), launcher)
        wait_status(
            bus,
            lambda status: status.tick > back.tick and any("recorder" in who for who in status.alive),
            launcher,
        )
        launcher.popen.send_signal(signal.SIGTERM)
        wait(bus, lambda event: event.topic == "gone" and event.message[0] == "sim")
    found = result(launcher)
    assert found["restarts"] == {"recorder": 1}
    assert Path(found["recording"]).name == "recording-2.rrd"
    with socket.create_server(("127.0.0.1", port)):  # the page is gone, its port is free
        pass


def test_a_killed_recorder_loses_at_most_the_last_second(start, world, tmp_path):
    place, speed = ["--name", world], 20
    started = [
        start("recorder", *place, "--output", tmp_path / "r.rrd", "--grpc-port", 0, "--web-port", -1),
        start("sim", *place, "--speed", speed),
        start("sensors", *place),
    ]
    second = round(speed / 0.5)
    with observer(world) as bus:
        wait_alive(bus, "recorder", *started)
        started.append(start("agent", *place))
        for ticks in (second, second + 17, second + 38):
            status = wait_status(bus, lambda status, least=ticks: status.tick > 2 * least, *started)
        started[0].kill()
    assert newest_tick(tmp_path / "r.rrd") >= status.tick - second
    whole = subprocess.run([RERUN, "rrd", "verify", salvaged(tmp_path / "r.rrd")], capture_output=True, check=False)
    assert whole.returncode == 0, whole.stderr


def test_another_run_is_another_recording(start, world, tmp_path):
    place = ["--name", world]
    recorder = start("recorder", *place, "--output", tmp_path, "--grpc-port", 0, "--web-port", -1)
    others = [start("sensors", *place), start("agent", *place)]
    ends = {}
    for run in ("first", "second"):
        sim = start("sim", *place, "--run", run, "--epochs", 300)
        with observer(world) as bus:
            end = wait_status(bus, lambda status, run=run: status.run == run and status.phase == "finished", sim)
            wait_for_recorder(bus, tmp_path / f"{run}.json", end.tick)  # it asks the others for the rest, but not sim
        ends[run] = end.tick
        assert sim.stop() == 0
    assert recorder.stop() == 0
    for process in others:
        process.stop()
    for run in ("first", "second"):
        file = tmp_path / f"{run}.rrd"
        assert subprocess.run([RERUN, "rrd", "verify", file], capture_output=True, check=False).returncode == 0
        assert sorted(series(file, "/plots/reward", "Scalars:scalars")) == list(range(ends[run] + 1))
        assert sorted(series(file, "/world/trail", "Points2D:positions")) == list(range(ends[run] + 1))
    listed = phototaxis("recordings", "--out", tmp_path, "--json")
    found = [json.loads(line) for line in listed.stdout.splitlines()]
    assert [recording["run"] for recording in found] == ["second", "first"]
    assert all(recording["arena"] == "paper" and recording["episodes"] > 0 for recording in found)
    kept = phototaxis("recordings", "--out", tmp_path, "--max-size", 0)
    assert kept.returncode == 0
    assert len(list(tmp_path.glob("*.rrd"))) == 2, "what has just been written stays"
    for file in tmp_path.glob("*.rrd"):
        os.utime(file, (0, 0))
    assert phototaxis("recordings", "--out", tmp_path, "--max-age", 1).returncode == 0
    assert not list(tmp_path.glob("*.rrd"))


def wait_for_recorder(bus, file: Path, tick: int) -> None:
    """Until the summary beside a recording tells of a tick."""
    wait(bus, lambda _: file.exists() and json.loads(file.read_text())["tick"] >= tick)
