"""What an FMU says, logged or printed: one line each, for the user, and no more than a person can read."""

import sys
import threading
from io import BufferedReader

SHOWN, SHOWN_ON_REQUEST = 20, 1000
"""Most lines of an FMU that are shown: without and with its logging on."""
LONGEST = 600
"""Most characters of a line; a longer one loses its middle."""
RAW = 8 * LONGEST
"""Most bytes of a line that are looked at."""
MARK = b"\x1e"
"""Begins a line of the FMU's logger, before its status; other lines were printed."""
STATUS = ("info", "warning", "discard", "error", "fatal error", "pending")


def one_line(said: bytes) -> str:
    """Whatever an FMU says, as one printable line of bounded length."""
    if len(said) > RAW:
        said = said[: RAW // 2] + said[-RAW // 2 :]
    words = " ".join(said.decode(errors="replace").split())
    text = "".join(one if one.isprintable() else "�" for one in words)
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 3]} … {text[-2 * LONGEST // 3 :]}"


class Log:
    """Shows on standard error what an FMU says, up to a number of lines.

    Parameters
    ----------
    label : names the FMU, as in "light FMU lag.fmu".
    everything : its logging is on from the beginning, and what is no warning is shown too.
    """

    def __init__(self, label: str, everything: bool = False):
        self.label, self.everything = label, everything
        self._left = SHOWN_ON_REQUEST if everything else SHOWN
        self._told = ""
        self._lock = threading.Lock()  # an FMU may have several processes

    def tell(self, line: str) -> None:
        """Say something of the FMU ourselves; the same again, of another of its processes, is not said."""
        if line != self._told:
            self._told = line
            self._show(line)

    def heard(self, said: bytes) -> str:
        """Show one line of it; what it said, in words."""
        kind = "printed"
        if said.startswith(MARK):
            kind, said = STATUS[min(said[1] - ord("0"), len(STATUS) - 1)], said[2:]
        text = one_line(said)
        with self._lock:
            self._left -= 1 if text else 0
            if text and self._left >= 0:
                self._show(f"{'' if kind == 'printed' else 'logs '}{kind}: {text}")
            elif text and self._left == -1:
                self._show(f"says more, which is not shown{'' if self.everything else ' (--fmu-log shows more)'}")
        return text

    def _show(self, line: str) -> None:
        print(f"sensors: {self.label} {line}", file=sys.stderr, flush=True)


class Listener:
    """Reads what one process of an FMU says, so that it never waits for a reader.

    Attributes
    ----------
    last : what it said last; "" for nothing.
    """

    def __init__(self, stream: BufferedReader, log: Log):
        self._stream, self._log, self.last = stream, log, ""
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def finish(self) -> None:
        """Hear the last words of a process that has ended."""
        self._thread.join(1.0)

    def _listen(self) -> None:
        with self._stream:
            whole = b""
            while part := self._stream.readline(RAW):
                if len(whole) < 2 * RAW:
                    whole += part
                if part.endswith(b"\n"):
                    self._hear(whole)
                    whole = b""
            self._hear(whole)

    def _hear(self, line: bytes) -> None:
        self.last = self._log.heard(line) or self.last
