"""Runs a Rerun viewer without a display, to save what it shows as pictures and to read its state."""

import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from phototaxis.runtime.disk import write_atomic
from phototaxis.runtime.errors import ComponentFailed
from phototaxis.runtime.ports import free_ports
from PIL import Image
from rerun.experimental import ViewerClient

from phototaxis_recorder.viewer import STARTS_WITHIN_S, rerun_program

SIZE_PIXELS = "1500x900"
FRAMES_PER_SECOND = 4
ANIMATION_WIDTH_PIXELS = 900


@contextmanager
def viewer(source: str) -> Iterator[Any]:
    """Run a viewer of a file or of a `rerun+http://` address; gives Rerun's ViewerClient.

    Raises
    ------
    ComponentFailed
        when the viewer does not start; it needs a Vulkan driver, and Mesa's software renderer is enough.
    """
    port = str(*free_ports(1))
    what = ["--connect", source] if source.startswith("rerun+") else [source]
    words = ["--headless", "--bind", "127.0.0.1", "--port", port, "--window-size", SIZE_PIXELS, *what]
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen([rerun_program(), *words], stdout=said, stderr=said)
        try:
            yield _connected(process, port, said)
        finally:
            process.terminate()
            process.wait()


def _connected(process: subprocess.Popen[bytes], port: str, said: Any) -> Any:
    deadline = time.monotonic() + STARTS_WITHIN_S
    while process.poll() is None and time.monotonic() < deadline:
        try:
            client = ViewerClient(f"rerun+http://127.0.0.1:{port}/proxy")
            client.get_state()
            return client
        except Exception:
            time.sleep(0.1)  # the program does not say when it is ready
    said.seek(0)
    lines = said.read().decode(errors="replace").strip().splitlines()
    raise ComponentFailed(
        "the Rerun viewer does not start without a display; it needs a Vulkan driver "
        f"(Debian: mesa-vulkan-drivers). Its last output: {lines[-1] if lines else 'none'}"
    )


def shown_tick(client: Any) -> int:
    """Return the tick that the viewer shows now; −1 while it shows none."""
    state = client.get_state()
    for recording in state.recordings:
        if recording.store_id == state.active_recording and recording.current_timeline == "tick":
            return -1 if recording.current_time is None else recording.current_time
    return -1


def picture(source: str, target: Path, seconds: float) -> None:
    """Write what the viewer shows: a .png after `seconds`, or a .gif of the `seconds` that follow those."""
    with viewer(source) as client, tempfile.TemporaryDirectory() as folder:
        time.sleep(seconds)  # the user chooses the moment
        if target.suffix == ".png":
            file = Path(folder) / "picture.png"
            client.save_screenshot(str(file))
            write_atomic(target, file.read_bytes())
            return
        frames = []
        for number in range(round(seconds * FRAMES_PER_SECOND)):
            file = Path(folder) / f"{number}.png"
            began = time.monotonic()
            client.save_screenshot(str(file))
            with Image.open(file) as image:
                height = round(image.height * ANIMATION_WIDTH_PIXELS / image.width)
                frames.append(image.convert("RGB").resize((ANIMATION_WIDTH_PIXELS, height)).quantize(96))
            time.sleep(max(began + 1 / FRAMES_PER_SECOND - time.monotonic(), 0))  # until the next frame
        film = BytesIO()
        duration = 1000 // FRAMES_PER_SECOND
        frames[0].save(film, "GIF", save_all=True, append_images=frames[1:], duration=duration, loop=0)
        write_atomic(target, film.getvalue())
