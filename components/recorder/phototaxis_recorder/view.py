"""`phototaxis view`: shows the live view or a finished recording, in the native viewer or in the browser."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta
from phototaxis.runtime.disk import check_writable
from phototaxis.runtime.errors import ComponentFailed, Unavailable, UserError
from phototaxis.runtime.options import parse
from phototaxis.runtime.ports import find_ports, viewer_url

from phototaxis_recorder.page import ViewerPage
from phototaxis_recorder.summary import recordings
from phototaxis_recorder.viewer import rerun_program, silence_rerun

PORT = Annotated[int, Meta(ge=0, le=65535)]


class Options(msgspec.Struct, kw_only=True):
    """Options of `phototaxis view`."""

    run: str = ""
    """a recording (.rrd), a run in --out, or "last"; without RUN: the live view of what is being recorded"""
    out: str = "runs"
    """folder of the runs"""
    web: bool = False
    """show it in the browser; this is the default where there is no display"""
    picture: str = ""
    """open no window, but write what the viewer shows into this file: .png, or .gif for an animation"""
    seconds: Annotated[float, Meta(ge=1, le=60)] = 5.0
    """seconds before the picture is taken, and length of the animation"""
    grpc_port: PORT = 9876
    """for the live view, the recorder's port; for a RUN in the browser, the port that serves it (0: any free one)"""
    web_port: PORT = 9090
    """port of the web viewer (with a RUN, 0: any free one)"""


def main(argv: Sequence[str]) -> int:
    about = "Open the live view, or with RUN (a file, a run's name, or last) a recording; both have the same layout."
    options = parse(Options, argv, "phototaxis view", about, positional=["run"])
    if options.picture and Path(options.picture).suffix not in (".png", ".gif"):
        raise UserError(f"--picture {options.picture}: it must end in .png or .gif")
    if options.picture:
        check_writable(Path(options.picture), "--picture")
    web = options.web or not has_display()
    silence_rerun()
    if options.run:
        with tempfile.TemporaryDirectory(prefix="phototaxis-") as folder:
            return show(str(whole(find(options.run, Path(options.out)), Path(folder))), options, web)
    try:
        socket.create_connection(("127.0.0.1", options.grpc_port), timeout=2).close()
    except OSError:
        raise Unavailable(
            f"nothing is being recorded on port {options.grpc_port}; start a run with: phototaxis up, "
            "or look at a finished one with: phototaxis view last"
        ) from None
    if options.picture:
        return draw(f"rerun+http://127.0.0.1:{options.grpc_port}/proxy", options)
    if web:
        print(viewer_url(options.web_port, options.grpc_port))
        return 0
    return native("--connect", f"rerun+http://127.0.0.1:{options.grpc_port}/proxy")


def has_display() -> bool:
    """Whether a native window can be opened here."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def find(run: str, folder: Path) -> Path:
    """Find the recording that `run` names: a file, a run in `folder`, or "last".

    Raises
    ------
    UserError
        when there is none.
    """
    if run.endswith(".rrd"):
        if Path(run).is_file():
            return Path(run)
        raise UserError(f"{run}: there is no such file")
    found = recordings(folder) if folder.is_dir() else []
    for recording in found:
        names = {recording.file.stem, recording.file.parent.name, recording.summary.run if recording.summary else ""}
        if run == "last" or run in names:
            return recording.file
    raise UserError(f"no recording of a run '{run}' in {folder}; see: phototaxis recordings --out {folder}")


def whole(file: Path, folder: Path) -> Path:
    """Return a recording that Rerun can open: the file itself if it is complete, else a copy of its readable part.

    A file is not complete while its recorder writes it, or after the recorder was killed.
    """
    rrd = [rerun_program(), "rrd"]
    if subprocess.run([*rrd, "verify", file], capture_output=True, check=False).returncode == 0:
        return file
    with file.open("rb") as found:
        if not found.read(3) == b"RRF":
            raise UserError(f"{file}: not a Rerun recording")
    copy = folder / file.name
    with copy.open("wb") as out:
        done = subprocess.run([*rrd, "optimize", "--continue-on-error", file], stdout=out, stderr=subprocess.DEVNULL)
    if done.returncode:
        raise UserError(f"{file}: no part of this recording can be read")
    return copy


def show(file: str, options: Options, web: bool) -> int:
    """Show a finished recording until Ctrl-C, or until the window is closed."""
    if options.picture:
        return draw(file, options)
    if not web:
        return native(file)
    grpc, web_port = find_ports("127.0.0.1", {"--grpc-port": options.grpc_port, "--web-port": options.web_port})
    page = ViewerPage("127.0.0.1", web_port, grpc)
    try:
        print(f"{file}: look at {viewer_url(web_port, grpc)} (Ctrl-C ends)", file=sys.stderr, flush=True)
        return native("--serve-grpc", "--bind", "127.0.0.1", "--port", str(grpc), file)
    finally:
        page.close()


def draw(source: str, options: Options) -> int:
    """Write the picture that --picture asks for."""
    from phototaxis_recorder.headless import picture

    picture(source, Path(options.picture), options.seconds)
    return 0


def native(*words: str) -> int:
    """Run Rerun's program until it ends; Ctrl-C ends it too."""
    viewer = subprocess.Popen([rerun_program(), *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    signal.signal(signal.SIGTERM, lambda *_: viewer.terminate())
    try:
        _, errors = viewer.communicate()
    except KeyboardInterrupt:
        viewer.terminate()
        viewer.communicate()
        raise
    if viewer.returncode not in (0, -signal.SIGTERM):
        last = (errors.strip().splitlines() or ["it printed no reason"])[-1]
        raise ComponentFailed(f"the Rerun viewer ended with exit code {viewer.returncode}: {last}")
    return 0
