"""The recording holds every tick, verifies, and shows what it should."""

import subprocess
import sys
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader
from support import result

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
