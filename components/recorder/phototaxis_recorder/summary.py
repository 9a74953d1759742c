"""The recordings on disk, and the summary that the recorder keeps beside each."""

from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import msgspec
from phototaxis.runtime.disk import write_atomic


class Summary(msgspec.Struct):
    """The outcome of a recorded run so far."""

    run: str
    arena: str
    arena_digest: str = ""
    """`Arena.digest`, because two different arenas may have the same name."""
    drivers: list[str] = []
    """The drivers, in the order of their first tick."""
    tick: int = -1
    """The newest tick."""
    epochs: int = 0
    """Learning steps so far: all ticks except the placements."""
    episodes: int = 0
    reached: int = 0
    recent: float = 0.0
    """Share of the last 50 episodes that reached the light."""


class RecordingFile(NamedTuple):
    """One recording on disk."""

    file: Path
    size: int
    """Size in bytes."""
    written: float
    """Time of the last write, s since 1970."""
    summary: Summary | None
    """None if there is no summary, or it cannot be read."""


def summary_file(file: Path) -> Path:
    """Return the path of a recording's summary."""
    return file.with_suffix(".json")


def write_summary(file: Path, summary: Summary) -> None:
    """Write the summary beside its recording, atomically; `Unavailable` when it cannot be written."""
    write_atomic(summary_file(file), msgspec.json.encode(summary))


def recordings(folder: Path) -> list[RecordingFile]:
    """Return all recordings in a folder and in its subfolders, the newest first."""
    found = []
    for file in {*folder.glob("*.rrd"), *folder.glob("*/*.rrd")}:
        summary = None
        with suppress(OSError, msgspec.DecodeError):
            summary = msgspec.json.decode(summary_file(file).read_bytes(), type=Summary)
        with suppress(FileNotFoundError):  # somebody has just removed it
            info = file.stat()
            found.append(RecordingFile(file, info.st_size, info.st_mtime, summary))
    return sorted(found, key=lambda recording: recording.written, reverse=True)
