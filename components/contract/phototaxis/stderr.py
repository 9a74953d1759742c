"""Standard error: a log on a full disk does not end the process that writes it."""

import io
import sys


class _Dropping(io.FileIO):
    """A file that takes everything, and keeps what can be written."""

    def write(self, data: object) -> int:
        try:
            return super().write(data)  # type: ignore[arg-type]
        except OSError:
            return len(memoryview(data))  # type: ignore[arg-type]


def may_be_lost() -> None:
    """From now on, what cannot be written to standard error is dropped; by default it would be an error."""
    if isinstance(sys.stderr, io.TextIOWrapper):
        file = io.BufferedWriter(_Dropping(sys.stderr.fileno(), "w", closefd=False))
        sys.stderr = io.TextIOWrapper(file, sys.stderr.encoding, sys.stderr.errors, line_buffering=True)
