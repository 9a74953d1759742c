"""Shows the user what an FMU logs or prints: one line for each message, and only as many as a person can read."""

import os
import sys
import threading
from contextlib import suppress
from typing import IO

MAX_LINES, MAX_LINES_ON_REQUEST = 20, 1000
"""Most lines of an FMU that are shown, without and with --fmu-log."""
MAX_LINE_CHARACTERS = 600
"""Most characters of a line; the middle of a longer line is left out."""
MAX_LINE_BYTES = 8 * MAX_LINE_CHARACTERS
"""Most bytes of a line that are decoded."""
READ_BYTES = 65536
"""Bytes that are read at once."""
MARK = b"\x1e"
"""Begins a line of the FMU's logger, and precedes its status; a line without it was printed by the FMU."""
STATUS = ("info", "warning", "discard", "error", "fatal error", "pending")


def one_line(said: bytes) -> str:
    """Convert any output of an FMU to one printable line of bounded length."""
    if len(said) > MAX_LINE_BYTES:
        said = said[: MAX_LINE_BYTES // 2] + said[-MAX_LINE_BYTES // 2 :]
    words = " ".join(said.decode(errors="replace").split())
    text = "".join(one if one.isprintable() else "�" for one in words)
    return (
        text
        if len(text) <= MAX_LINE_CHARACTERS
        else f"{text[: MAX_LINE_CHARACTERS // 3]} … {text[-2 * MAX_LINE_CHARACTERS // 3 :]}"
    )


class Log:
    """Shows the output of an FMU on standard error, up to a number of lines; a repeated line is shown once.

    Parameters
    ----------
    label : names the FMU, as in "light FMU lag.fmu".
    everything : whether its logging is on from the beginning, and messages below a warning are shown too.
    most : most lines to show.
    """

    def __init__(self, label: str, everything: bool = False, most: int = MAX_LINES):
        self.label, self.everything = label, everything
        self._most, self._shown, self._last = most, 0, ""
        self._lock = threading.Lock()  # an FMU may have several processes

    @property
    def full(self) -> bool:
        """Whether no more lines are shown."""
        return self._shown > self._most

    def tell(self, line: str) -> None:
        """Print a line of our own about the FMU."""
        if line != self._last:
            self._last = line
            print(f"sensors: {self.label} {line}", file=sys.stderr, flush=True)

    def heard(self, said: str) -> None:
        """Show a line that comes from the FMU."""
        with self._lock:
            if self.full or said == self._last:
                return
            self._shown += 1
            more = "" if self._most >= MAX_LINES_ON_REQUEST else " (--fmu-log shows more)"
            self.tell(f"has more output, which is not shown{more}" if self.full else said)


class Listener:
    """Reads the output of one process of an FMU, so that the process never waits for a reader.

    Attributes
    ----------
    last : the last line of its output; "" for none.
    """

    def __init__(self, stream: IO[bytes], log: Log):
        self._stream, self._log, self.last = stream, log, ""
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def finish(self) -> None:
        """Read the rest of the output of a process that has ended."""
        self._thread.join(1.0)

    def _listen(self) -> None:
        with self._stream:
            line = b""
            while part := os.read(self._stream.fileno(), READ_BYTES):
                *lines, line = (line + part).split(b"\n")
                for one in lines[-1:] if self._log.full else lines:
                    self._hear(one)
                if len(line) > 2 * READ_BYTES:
                    line = line[:READ_BYTES] + line[-READ_BYTES:]
            self._hear(line)

    def _hear(self, line: bytes) -> None:
        kind = ""
        if line.startswith(MARK):
            kind, line = STATUS[min(line[1] - ord("0"), len(STATUS) - 1)], line[2:]
        if text := one_line(line):
            self.last = text
            with suppress(OSError, ValueError):  # our standard error may be closed; the FMU goes on
                self._log.heard(f"logs {kind}: {text}" if kind else f"prints: {text}")
