"""The file of a recording: what Rerun writes comes through a pipe, so that a full disk is ours to notice.

Rerun's own writer says nothing when it fails, and waits for ever if it fails while it is flushed. What it writes
into the pipe always goes somewhere: into the file, or nowhere once the file has failed.
"""

import array
import fcntl
import os
import select
import termios
import threading
import time
from contextlib import suppress
from itertools import count
from pathlib import Path

from phototaxis.runtime.disk import write_all

CHUNK_BYTES = 1 << 20
PAUSE_S = 0.001


class RecordingFile:
    """A file that is written by a thread of its own.

    Parameters
    ----------
    wanted : its path; where a file stands already, the new one gets a number.

    Attributes
    ----------
    path : the path that it got.
    sink : the path of the pipe, for Rerun to open and write.
    error : why the file is written no more; None while it is.

    Raises
    ------
    OSError
        when it cannot be made.
    """

    def __init__(self, wanted: Path):
        self.path = fresh_file(wanted)
        self.error: OSError | None = None
        self._file = os.open(self.path, os.O_WRONLY | os.O_APPEND)
        self._read, self._write = os.pipe()
        self.sink = f"/dev/fd/{self._write}"
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._copy, daemon=True)
        self._thread.start()

    def settle(self) -> int:
        """Wait until everything that was put into the pipe is written; the size of the file.

        Raises
        ------
        OSError
            when the file is written no more.
        """
        while self._waiting():
            time.sleep(PAUSE_S)
        if self.error is not None:
            raise self.error
        return self.path.stat().st_size

    def cut(self, size: int) -> None:
        """Leave the first `size` bytes of the file; with 0 no file. It is written no more."""
        with self._lock, suppress(OSError):
            self.error = self.error or OSError("cut short")
            os.truncate(self.path, size) if size else self.path.unlink()

    def close(self) -> None:
        """After Rerun has closed its end."""
        os.close(self._write)
        self._thread.join()
        os.close(self._read)
        os.close(self._file)

    def _waiting(self) -> int:
        """Bytes in the pipe; 0 when the last of them are written, too."""
        found = array.array("i", [0])
        with self._lock:
            fcntl.ioctl(self._read, termios.FIONREAD, found)
        return found[0]

    def _copy(self) -> None:
        """Copy until the pipe is closed: between reading and writing nobody else has the lock."""
        while True:
            select.select([self._read], [], [])
            with self._lock:
                data = os.read(self._read, CHUNK_BYTES)
                if not data:
                    return
                if self.error is None:
                    try:
                        write_all(self._file, data)
                    except OSError as error:
                        self.error = error


def fresh_file(wanted: Path) -> Path:
    """Make `wanted`, or the same with -2, -3, … where a file stands already: no recording is overwritten."""
    for number in count(1):
        file = wanted if number == 1 else wanted.with_name(f"{wanted.stem}-{number}{wanted.suffix}")
        with suppress(FileExistsError):
            file.touch(exist_ok=False)
            return file
    raise AssertionError
