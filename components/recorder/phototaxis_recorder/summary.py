"""What there is on disk: recordings, and the summary that the recorder keeps beside each."""

from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import msgspec
from phototaxis.runtime.disk import write_atomic


class Summary(msgspec.Struct):
    """What a recording came to so far."""

    run: str
    arena: str
    arena_digest: str = ""
    """`Arena.digest`: two worlds may have one name."""
    drivers: list[str] = []
    """Who drove, in the order of their first tick."""
    tick: int = -1
    """The newest tick."""
    epochs: int = 0
    """Learning steps so far: ticks without the placements."""
    episodes: int = 0
    reached: int = 0
    recent: float = 0.0
    """Share of the last 50 episodes that reached the light."""


class RecordingFile(NamedTuple):
    """One recording on disk."""

    file: Path
    size: int
    """Bytes."""
    written: float
    """When it was written to last, s since 1970."""
    summary: Summary | None
    """None where it has none that can be read."""


def summary_file(file: Path) -> Path:
    """Where the summary of a recording stands."""
    return file.with_suffix(".json")


def write_summary(file: Path, summary: Summary) -> None:
    """Put the summary beside its recording, whole or not at all; `Unavailable` when it cannot be written."""
    write_atomic(summary_file(file), msgspec.json.encode(summary))


def recordings(folder: Path) -> list[RecordingFile]:
    """All recordings in a folder and the folders of runs in it, the newest first."""
    found = []
    for file in {*folder.glob("*.rrd"), *folder.glob("*/*.rrd")}:
        summary = None
        with suppress(OSError, msgspec.DecodeError):
            summary = msgspec.json.decode(summary_file(file).read_bytes(), type=Summary)
        with suppress(FileNotFoundError):  # somebody removes it just now
            info = file.stat()
            found.append(RecordingFile(file, info.st_size, info.st_mtime, summary))
    return sorted(found, key=lambda recording: recording.written, reverse=True)
