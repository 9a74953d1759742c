"""Where a recording goes: a file, and the live gRPC server."""

import os
import subprocess
from pathlib import Path

import rerun as rr
from phototaxis.messages import World
from phototaxis.viewer import rerun_program

from phototaxis_recorder.layout import blueprint

LARGE = 250_000_000
"""Bytes above which a recording is not rewritten at its end: that takes more than twice as much memory."""


def open_recording(world: World, file: Path, host: str, grpc_port: int, memory: str) -> rr.RecordingStream:
    """A recording that goes to a file and to a live server at the same time.

    The file has no footer while it grows: Rerun would keep the footer's entries in memory, some 20 MB a minute
    at full speed. `complete` adds it.
    """
    recording = rr.RecordingStream("phototaxis", recording_id=f"{world.run}-{file.stem}")
    rr.set_log_time_enabled(False, recording=recording)
    server = rr.GrpcServerSink(host, grpc_port, server_memory_limit=memory)
    disk = rr.FileSink(str(file), write_footer=False)
    recording.set_sinks(server, disk, default_blueprint=blueprint(world.arena, world.epochs))
    recording.send_recording_name(f"{world.arena.name}, {world.run}")
    return recording


def fresh_file(wanted: Path) -> Path:
    """`wanted`, or the same with -2, -3, … where a file stands already: no recording is overwritten."""
    file, number = wanted, 1
    while file.exists():
        number += 1
        file = wanted.with_name(f"{wanted.stem}-{number}{wanted.suffix}")
    return file


def complete(file: Path) -> None:
    """Give a closed recording its footer and larger chunks, so that it opens fast; a large one stays as it is."""
    if not file.exists() or file.stat().st_size > LARGE:
        return
    part = file.with_suffix(".part")
    command = [rerun_program(), "rrd", "optimize", file, "-o", part]
    if subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0:
        os.replace(part, file)
    else:
        part.unlink(missing_ok=True)
