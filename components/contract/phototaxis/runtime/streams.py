"""Standard streams as a program needs them, whatever it was started with."""

import io
import os
import sys


class _Dropping(io.FileIO):
    """A file that takes everything, and keeps what can be written."""

    def write(self, data: object) -> int:
        try:
            return super().write(data)  # type: ignore[arg-type] - any buffer, as FileIO takes it
        except OSError:
            return len(memoryview(data))  # type: ignore[arg-type] - the same


def prepare() -> None:
    """Stand in for standard streams that are closed; write "?" for characters that a terminal or pipe does not have.

    Without a stand-in the next file or socket that is opened would get the number of the closed stream, and with it
    whatever libraries print. What cannot be written to standard error is dropped: a log on a full disk does not end
    the process that writes it.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))
        if number and isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    stderr = sys.__stderr__
    if isinstance(stderr, io.TextIOWrapper) and sys.stderr is stderr:  # not one of a test or a notebook
        file = io.BufferedWriter(_Dropping(stderr.fileno(), "w", closefd=False))
        sys.stderr = io.TextIOWrapper(file, stderr.encoding, "replace", line_buffering=True)
