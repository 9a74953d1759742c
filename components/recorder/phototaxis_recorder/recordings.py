"""`phototaxis recordings`: lists recordings, and removes those that are old or exceed a total size."""

import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import parse

from phototaxis_recorder.summary import RecordingFile, recordings, summary_file

DAY_S, MEGABYTE_BYTES = 86_400, 1_000_000
BUSY_S = 60.0
"""A recording that was written to within this many seconds is in use, and is not removed."""


class Options(msgspec.Struct, kw_only=True):
    """Options of `phototaxis recordings`."""

    out: str = "runs"
    """folder of the runs"""
    max_age: Annotated[float, Meta(ge=0, examples=[30])] | None = None
    """remove recordings older than this many days"""
    max_size: Annotated[float, Meta(ge=0, examples=[1000])] | None = None
    """keep the newest recordings, up to this many megabytes in total, and remove the others"""
    dry_run: bool = False
    """only print what would be removed"""
    json: bool = False
    """print one JSON object for each recording"""


def main(argv: Sequence[str]) -> int:
    about = "List the recordings, newest first; with --max-age or --max-size remove those that exceed the limit."
    options = parse(Options, argv, "phototaxis recordings", about)
    folder = Path(options.out)
    if not folder.is_dir():
        raise UserError(f"--out {folder}: there is no such folder")
    found = recordings(folder)
    doomed = excess(found, time.time(), options.max_age, options.max_size)
    for recording in doomed:
        if not options.dry_run:
            try:
                recording.file.unlink(missing_ok=True)
                summary_file(recording.file).unlink(missing_ok=True)
            except OSError as error:
                raise UserError(f"{recording.file}: cannot be removed: {error.strerror}") from None
        print(f"{'would remove' if options.dry_run else 'removed'} {recording.file}", file=sys.stderr)
    rest = found if options.dry_run else [recording for recording in found if recording not in doomed]
    if options.json:
        for recording in rest:
            print(msgspec.json.encode(as_object(recording)).decode())
    elif rest:
        print("\n".join(table(rest)))
    else:
        print(f"no recordings in {folder}", file=sys.stderr)
    return 0


def excess(
    found: list[RecordingFile], now: float, max_age: float | None, max_size: float | None
) -> list[RecordingFile]:
    """Return the recordings to remove: those above an age in days or a total size in MB that are not in use.

    `found` has the newest first; `now` is in seconds since 1970.
    """
    doomed, total = [], 0
    for recording in found:
        total += recording.size
        old = max_age is not None and now - recording.written > max_age * DAY_S
        much = max_size is not None and total > max_size * MEGABYTE_BYTES
        if (old or much) and now - recording.written > BUSY_S:
            doomed.append(recording)
    return doomed


def as_object(recording: RecordingFile) -> dict[str, object]:
    """Return a recording as the object that --json prints."""
    summary = msgspec.to_builtins(recording.summary) if recording.summary else {}
    return {"file": str(recording.file), "bytes": recording.size, "written": recording.written, **summary}


def table(found: list[RecordingFile]) -> list[str]:
    """Return the recordings as lines with aligned columns."""
    rows: list[tuple[str, ...]] = [("recording", "run", "arena", "drivers", "epochs", "success", "MB")]
    worlds = {(one.summary.arena, one.summary.arena_digest) for one in found if one.summary is not None}
    names = Counter(name for name, _ in worlds)
    for file, size, _, summary in found:
        known = ("?",) * 5
        if summary is not None:
            newest = f"{summary.reached} of {summary.episodes}, last {min(summary.episodes, 50)}: {summary.recent:.0%}"
            success = newest if summary.episodes else "no episode has ended"
            arena = summary.arena if names[summary.arena] == 1 else f"{summary.arena} ({summary.arena_digest[:4]})"
            known = (summary.run, arena, ", ".join(summary.drivers), str(summary.epochs), success)
        rows.append((str(file), *known, f"{size / MEGABYTE_BYTES:.1f}"))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
