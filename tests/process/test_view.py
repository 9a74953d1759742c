"""What people see: the viewer shows the newest tick; recordings open again, also those of a killed recorder."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from phototaxis.runtime.errors import ComponentFailed, Unavailable, UserError
from phototaxis.runtime.ports import free_ports
from phototaxis_recorder import view
from phototaxis_recorder.headless import picture, shown_tick, viewer
from PIL import Image
from rerun_files import RERUN
from support import DEADLINE, children, observer, phototaxis, wait_status


@pytest.fixture(scope="module")
def gpu(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A Vulkan driver, real or in software."""
    folder = tmp_path_factory.mktemp("gpu")
    os.environ.setdefault("XDG_RUNTIME_DIR", str(folder))
    try:
        with viewer("rerun+http://127.0.0.1:1/proxy"):
            pass
    except ComponentFailed as error:
        if os.environ.get("PHOTOTAXIS_NEEDS_VULKAN"):
            pytest.fail(str(error))
        pytest.skip(str(error))


def test_the_viewer_shows_the_newest_tick(gpu, start, world, tmp_path):
    (port,) = free_ports(1)
    words = ("up", "--name", world, "--out", tmp_path, "--epochs", 0, "--speed", 10, "--web-port", -1, "--json")
    launcher = start(*words, "--grpc-port", port)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 20, launcher)
        with viewer(f"rerun+http://127.0.0.1:{port}/proxy") as client:
            for _ in range(3):
                now = wait_status(bus, lambda status: status.phase == "running", launcher).tick
                deadline = time.monotonic() + DEADLINE
                while shown_tick(client) < now:
                    assert time.monotonic() < deadline, f"shows {shown_tick(client)}, not {now}"
                    launcher.alive()
                    wait_status(bus, lambda status: True, launcher)
        picture(f"rerun+http://127.0.0.1:{port}/proxy", tmp_path / "live.gif", 1.0)
        with Image.open(tmp_path / "live.gif") as animation:
            assert animation.size[0] == 900
            assert len(animation.getcolors(100_000) or ()) > 30, "an empty picture"
        os.kill(children(launcher.popen.pid)["recorder"], signal.SIGKILL)
        launcher.popen.send_signal(signal.SIGTERM)
    launcher.end()


def test_a_recording_that_nobody_closed_is_mended_for_the_viewer(up, world, tmp_path):
    launcher = up("--epochs", 0, "--speed", 20)
    with observer(world) as bus:
        wait_status(bus, lambda status: status.tick > 100, launcher)
        os.kill(children(launcher.popen.pid)["recorder"], signal.SIGKILL)
        launcher.popen.send_signal(signal.SIGTERM)
    launcher.end()
    broken = next((tmp_path / "runs").glob("*/recording.rrd"))
    assert subprocess.run([RERUN, "rrd", "verify", broken], capture_output=True, check=False).returncode != 0
    mended = view.whole(broken, tmp_path)
    assert subprocess.run([RERUN, "rrd", "verify", mended], capture_output=True, check=False).returncode == 0


def test_what_cannot_be_viewed_is_one_line(tmp_path: Path):
    (tmp_path / "not.rrd").write_bytes(b"no recording")
    with pytest.raises(UserError, match="not a Rerun recording"):
        view.whole(tmp_path / "not.rrd", Path(os.path.dirname(tmp_path)))
    with pytest.raises(UserError, match="no recording of a run 'x'"):
        view.find("x", tmp_path)
    with pytest.raises(Unavailable, match="nothing is being recorded"):
        view.main(["--grpc-port", str(*free_ports(1))])
    failed = phototaxis("view", "--picture", "x.jpg")
    assert failed.returncode == 2
    assert failed.stderr.count("\n") == 1
