"""The folder of a run."""

import shutil
from contextlib import suppress
from pathlib import Path

from phototaxis.disk import make_folder, try_folder, unwritten
from phototaxis.messages import run_name


class RunFolder:
    """A fresh folder in `out` that is called as its run; of runs that start at the same moment each has its own.

    Raises
    ------
    UserError, Unavailable
        when it cannot be made, or the disk is full.
    """

    def __init__(self, out: Path):
        self._made = [part for part in (out.resolve(), *out.resolve().parents) if not part.exists()]
        try_folder(out, "--out", keep=True)  # taken away again, it might be missing to a run that starts now
        self.path = self._fresh(out.resolve())

    def remove(self) -> None:
        """Take the folder away with all that is in it, and what had to be made for it where nothing else is in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        with suppress(OSError):
            for part in self._made:
                part.rmdir()

    def _fresh(self, out: Path) -> Path:
        while True:
            make_folder(out)
            folder = out / run_name()
            try:
                folder.mkdir()
                return folder
            except (FileExistsError, FileNotFoundError):  # another run took the name, or `out` away
                continue
            except OSError as error:
                raise unwritten(folder, error) from None
