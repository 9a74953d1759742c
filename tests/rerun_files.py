"""Reading recordings back, also those that nobody closed."""

import subprocess
from pathlib import Path
from typing import Any

from phototaxis_recorder.viewer import rerun_program
from rerun.chunk import RrdReader

RERUN = str(rerun_program())
"""The program itself: the script of that name would leave it an orphan."""


def series(file: str | Path, entity: str, component: str) -> dict[int, Any]:
    """tick → value of one component of one entity."""
    found = {}
    for chunk in RrdReader(file).stream():
        if str(chunk.entity_path) == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            if component in batch.schema.names:
                found.update(zip(batch["tick"].to_pylist(), batch[component].to_pylist(), strict=True))
    return found


def salvaged(file: Path) -> Path:
    """A copy of what can be read of a file that ends anywhere, with a footer."""
    copy = file.with_suffix(".salvaged.rrd")
    with copy.open("wb") as out:
        words = [RERUN, "rrd", "merge", "--continue-on-error", str(file)]
        subprocess.run(words, stdout=out, stderr=subprocess.DEVNULL, check=True)
    return copy


def newest_tick(file: Path) -> int:
    """The newest pose in a file that may still be written; −1 before there is one."""
    if not file.exists() or not file.stat().st_size:
        return -1
    return max(series(salvaged(file), "/world/trail", "Points2D:positions"), default=-1)
