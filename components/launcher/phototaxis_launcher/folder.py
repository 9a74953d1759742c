"""The folder of a run."""

from contextlib import suppress
from pathlib import Path

from phototaxis.disk import try_folder
from phototaxis.messages import run_name


def run_folder(out: Path) -> Path:
    """Make a folder in `out` that is called as its run; of runs that start at the same moment each has its own.

    Raises
    ------
    UserError, Unavailable
        when it cannot be made, or the disk is full.
    """
    try_folder(out.resolve(), "--out")
    while True:
        folder = out.resolve() / run_name()
        with suppress(FileExistsError):
            folder.mkdir()
            return folder
