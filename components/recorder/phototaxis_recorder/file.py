"""The file of a recording: Rerun writes into a pipe, and we write the file, so that we notice a full disk.

Rerun's own file writer reports no errors, and a flush never returns after one. The pipe is always read: its bytes go
into the file, or are dropped once writing the file has failed.
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
    """Writes everything that comes through a pipe into a file, in a thread of its own.

    Parameters
    ----------
    wanted : path of the file; if a file exists there, the new one gets a number.

    Attributes
    ----------
    path : path of the file that is written.
    sink : path of the pipe, for Rerun to open and write.
    error : the error that has ended the writing; None while all is well.

    Raises
    ------
    OSError
        when the file cannot be made.
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
        """Wait until everything in the pipe is written, and return the size of the file.

        Raises
        ------
        OSError
            when the writing has ended with an error.
        """
        while self._waiting():
            time.sleep(PAUSE_S)
        if self.error is not None:
            raise self.error
        return self.path.stat().st_size

    def cut(self, size: int) -> None:
        """Stop writing, and keep only the first `size` bytes of the file; with 0, remove it."""
        with self._lock, suppress(OSError):
            self.error = self.error or OSError("cut short")
            os.truncate(self.path, size) if size else self.path.unlink()

    def close(self) -> None:
        """Close the file and the pipe; call it after Rerun has closed its end."""
        os.close(self._write)
        self._thread.join()
        os.close(self._read)
        os.close(self._file)

    def _waiting(self) -> int:
        """Return the number of bytes in the pipe; 0 means that the last of them are in the file too."""
        found = array.array("i", [0])
        with self._lock:
            fcntl.ioctl(self._read, termios.FIONREAD, found)
        return found[0]

    def _copy(self) -> None:
        """Copy until the pipe is closed; the lock makes reading and writing one step for the other thread."""
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
    """Create the file `wanted`, or if it exists, one with -2, -3, … in its name; no recording is overwritten."""
    for number in count(1):
        file = wanted if number == 1 else wanted.with_name(f"{wanted.stem}-{number}{wanted.suffix}")
        with suppress(FileExistsError):
            file.touch(exist_ok=False)
            return file
    raise AssertionError
