"""The folder of a run."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from phototaxis.runtime.disk import check_folder_writable, make_folder, write_failure
from phototaxis.runtime.errors import ComponentFailed, UserError
from phototaxis.wire.messages import run_name


class RunFolder:
    """A fresh folder in `out` that is called as its run; of runs that start at the same moment each has its own.

    Attributes
    ----------
    begun : whether the run has begun, so that there is something to keep.

    Raises
    ------
    UserError, Unavailable
        when it cannot be made, or the disk is full.
    """

    def __init__(self, out: Path):
        self._made = [part for part in (out.resolve(), *out.resolve().parents) if not part.exists()]
        check_folder_writable(out, "--out", keep=True)  # taken away again, it might be missing to a run that starts now
        self.path = self._fresh(out.resolve())
        self.begun = False

    @property
    def run(self) -> str:
        """The run's name."""
        return self.path.name

    @property
    def recordings(self) -> list[Path]:
        """All recordings that there are, the newest last."""
        return sorted(self.path.glob("recording*.rrd"), key=lambda file: file.stat().st_mtime)

    def checkpoint(self, agent: str) -> Path:
        """That of the agent with this name among the launcher's processes."""
        return self.path / f"{agent.replace('agent', 'checkpoint')}.npz"

    @contextmanager
    def kept_once_begun(self) -> Iterator[None]:
        """Remove the folder when the user's input or a missing peer keeps the run from beginning."""
        try:
            yield
        except UserError as error:
            if not self.begun and not isinstance(error, ComponentFailed):
                self.remove()
            raise

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
                raise write_failure(folder, error) from None
