"""The recording holds every tick, verifies, and shows what it should."""

import os
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader
from support import children, observer, result, wait, wait_status

RERUN = str(Path(sys.executable).with_name("rerun"))


def series(file: str, entity: str, component: str) -> dict[int, Any]:
    """tick → value of one component of one entity."""
    found = {}
    for chunk in RrdReader(file).stream():
        if str(chunk.entity_path) == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            if component in batch.schema.names:
                found.update(zip(batch["tick"].to_pylist(), batch[component].to_pylist(), strict=True))
    return found


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
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
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
        launcher.popen.send_signal(signal.SIGINT)
        wait(bus, lambda event: event.topic == "gone" and event.message[0] == "sim")
    found = result(launcher)
    assert found["restarts"] == {"recorder": 1}
    assert Path(found["recording"]).name == "recording-2.rrd"
    with socket.create_server(("127.0.0.1", port)):  # the page is gone, its port is free
        pass
