"""The options that all commands share that compute many cells: where, how many at a time, and the seeds."""

from typing import Annotated, Literal

from msgspec import Meta, Struct
from phototaxis.runtime.errors import UserError

SEEDS = Annotated[
    str, Meta(pattern=r"^[0-9]+:[0-9]+$", description="A:B, the seeds from A to B − 1", examples=["0:20"])
]


class Running(Struct, kw_only=True):
    """Options of the commands that compute many cells."""

    jobs: Annotated[int, Meta(ge=-1, le=10_000)] = -1
    """number of processes; -1: one for each core"""
    backend: Literal["local", "dask"] = "local"
    """where to compute: this machine, or a Dask cluster whose workers have phototaxis installed"""
    scheduler: str = ""
    """address of the Dask scheduler, as in tcp://HOST:8786; it must be trusted, as Dask's messages can run any code"""

    def __post_init__(self) -> None:
        if self.backend == "dask" and not self.scheduler:
            raise ValueError("--backend dask needs the address of a scheduler: --scheduler tcp://HOST:8786")
        if self.jobs == 0:
            raise ValueError("--jobs 0: at least one process is needed, or -1 for one on each core")


def seed_range(text: str) -> range:
    """Return the seeds A to B − 1 of "A:B"; UserError when there are none."""
    first, _, end = text.partition(":")
    seeds = range(int(first), int(end))
    if not seeds:
        raise UserError(f"--seeds {text}: no seed from {first} to {end}")
    return seeds
