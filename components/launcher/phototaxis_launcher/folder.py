"""The folder of a run."""

from pathlib import Path

from phototaxis.errors import UserError
from phototaxis.messages import run_name


def run_folder(out: Path) -> Path:
    """Make a folder in `out` that is called as its run; of runs that start at the same moment each has its own.

    Raises
    ------
    UserError
        when it cannot be made.
    """
    while True:
        folder = out.resolve() / run_name()
        try:
            folder.mkdir(parents=True)
            return folder
        except FileExistsError:
            continue
        except OSError as error:
            raise UserError(f"--out {out}: {error.strerror}") from None
