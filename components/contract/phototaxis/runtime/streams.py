"""Makes the standard streams safe to use, however the program was started."""

import io
import os
import sys


class _Dropping(io.FileIO):
    """A file whose writes never fail: data that cannot be written is dropped."""

    def write(self, data: object) -> int:
        try:
            return super().write(data)  # type: ignore[arg-type] - any buffer, as FileIO takes it
        except OSError:
            return len(memoryview(data))  # type: ignore[arg-type] - the same


def prepare() -> None:
    """Replace closed standard streams; write "?" for characters that the terminal or pipe cannot encode.

    Otherwise the next file or socket would get the descriptor of the closed stream, and receive whatever libraries
    print. Data that cannot be written to standard error is dropped, so that a log on a full disk does not end the
    process.
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
