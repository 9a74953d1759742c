"""Runs schedules, one or many at once, and reports the result of each."""

import gc
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import joblib
from phototaxis.runtime.errors import UserError

from simulated.schedule import EPOCHS, Schedule, make
from simulated.storm import Storm
from simulated.taken import counting
from simulated.witness import Broken

gc.freeze()  # what the modules hold lives as long as a worker: to look through it again and again costs some 5%


class Found(NamedTuple):
    """What became of a schedule."""

    wrong: str
    """The invariant that broke, or the error that a user would see; "" where all is well."""
    ticks: int
    faults: Counter[str]
    """What befell the system, by kind."""
    taken: Counter[tuple[str, str, str]]
    """Transitions by machine, state and input, if they were counted."""


def run(schedule: Schedule, covered: bool = False) -> Found:
    """Carry out a schedule. Any other exception than what `Found.wrong` tells is a defect of this harness."""
    taken, shared = Counter[tuple[str, str, str]](), Path("/dev/shm")  # noqa: S108 - a folder in it has a random name
    with (
        tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as folder,
        counting(taken) if covered else nullcontext(),
    ):
        try:
            storm = Storm(schedule, Path(folder))
            return Found("", storm.run(), storm.counts, taken)
        except (Broken, UserError) as error:
            return Found(f"{type(error).__name__}: {error}", 0, Counter(), taken)


def results(seeds: range, epochs: int = EPOCHS, covered: bool = False) -> Iterator[tuple[int, Found]]:
    """Each seed with what becomes of its schedule of so many epochs, on all cores."""
    parallel: Any = joblib.Parallel  # its stubs know neither numbers for batch_size nor generators
    return parallel(n_jobs=-1, batch_size=8, return_as="generator")(
        joblib.delayed(_numbered)(seed, epochs, covered) for seed in seeds
    )


def _numbered(seed: int, epochs: int, covered: bool) -> tuple[int, Found]:
    return seed, run(make(seed, epochs), covered)
