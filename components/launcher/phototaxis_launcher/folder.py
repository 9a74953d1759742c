"""The folder that holds the recording, checkpoints and logs of a run."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from phototaxis.runtime.disk import check_folder_writable, make_folder, write_failure
from phototaxis.runtime.errors import ComponentFailed, UserError
from phototaxis.wire.messages import run_name


class RunFolder:
    """Makes a fresh folder in `out`, named after its run; runs that start at the same moment get different folders.

    Attributes
    ----------
    begun : whether the run has begun, so that the folder holds something to keep.

    Raises
    ------
    UserError, Unavailable
        when the folder cannot be made, or the disk is full.
    """

    def __init__(self, out: Path):
        self._made = [part for part in (out.resolve(), *out.resolve().parents) if not part.exists()]
        check_folder_writable(out, "--out", keep=True)  # removing it could break another run that starts now
        self.path = self._fresh(out.resolve())
        self.begun = False

    @property
    def run(self) -> str:
        """The run's name."""
        return self.path.name

    @property
    def recordings(self) -> list[Path]:
        """All recordings in the folder, the newest last."""
        return sorted(self.path.glob("recording*.rrd"), key=lambda file: file.stat().st_mtime)

    def checkpoint(self, agent: str) -> Path:
        """Path of the checkpoint of an agent; `agent` is the name of its process, as in "agent-2"."""
        return self.path / f"{agent.replace('agent', 'checkpoint')}.npz"

    @contextmanager
    def kept_once_begun(self) -> Iterator[None]:
        """Remove the folder if the run fails before it begins because of the user's input or a missing peer."""
        try:
            yield
        except UserError as error:
            if not self.begun and not isinstance(error, ComponentFailed):
                self.remove()
            raise

    def remove(self) -> None:
        """Remove the folder and its content, and those of its parents that were made for it and are empty."""
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
            except (FileExistsError, FileNotFoundError):  # another run took the name, or removed `out`
                continue
            except OSError as error:
                raise write_failure(folder, error) from None
