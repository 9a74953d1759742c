"""Child processes of the launcher: it starts and watches them, restarts those that die, and ends them all."""

import os
import subprocess
import sys
import time
from collections import deque
from pathlib import Path
from typing import IO

from phototaxis.runtime.component import unique_name
from phototaxis.runtime.disk import check_writable, write_failure
from phototaxis.runtime.errors import ERROR, WARNING, ComponentFailed, Unavailable, UserError

MAX_RESTARTS = 3
WITHIN_S = 20.0
"""The launcher gives up on a component that dies more than MAX_RESTARTS times within this many seconds."""
USER_ERRORS = {2: UserError, 3: Unavailable, 4: ComponentFailed}
"""Exit codes of a component that has explained in one line why it ends. A restart would end the same way."""


class Child:
    """One component process; its output goes to a log file.

    The child is tethered: when the launcher ends, even by a crash, the child's standard input closes and the
    child ends too.

    Parameters
    ----------
    name : the component's name in messages, and the name of its log file.
    module : Python module to run.
    label : if given, each start of the process gets a fresh name on the bus that begins with this label.
    may_leave : whether the process may end by itself without an error; if not, the launcher then restarts it.

    Attributes
    ----------
    idents : all names that the child has had on the bus, the newest last.
    left : whether the child ended by itself, without an error.
    """

    def __init__(
        self, name: str, module: str, arguments: list[str], folder: Path, label: str = "", may_leave: bool = False
    ):
        self.name, self.label, self._may_leave = name, label, may_leave
        self._module, self._arguments = module, arguments
        self._log, self._read = folder / f"{name}.log", 0
        self.idents: list[str] = []
        self.left = False
        self._deaths: deque[float] = deque(maxlen=MAX_RESTARTS + 1)
        self.restarts = 0
        self.process: subprocess.Popen[bytes] | None = None

    def start(self, *extra: str) -> None:
        """Start the process in a session of its own, so that Ctrl-C reaches only the launcher."""
        if self.label:
            self.idents.append(unique_name(self.label))
            extra = *extra, f"--ident={self.idents[-1]}"
        with self._open_log() as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", self._module, "--tethered", *self._arguments, *extra],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                start_new_session=True,
                env=os.environ | {"PYTHONFAULTHANDLER": "1"},  # so that the log shows where a crash happened
            )

    def _open_log(self) -> IO[bytes]:
        try:
            return self._log.open("ab")
        except OSError as error:
            raise write_failure(self._log, error) from None

    def watch(self) -> bool:
        """Restart the process if it has died, and return whether it was restarted.

        If the process may leave and has ended without an error, set `left` instead.

        Raises
        ------
        UserError, Unavailable, ComponentFailed
            when the process explained in one line why it ended.
        ComponentFailed
            also when the process keeps dying; the text ends with its last output.
        """
        if self.process is None or self.process.poll() is None:
            return False
        code = self.process.returncode
        if code == 0 and self._may_leave:
            self.left = True
            return False
        if code in USER_ERRORS:
            raise USER_ERRORS[code](self.fault())
        self.bring_back()
        return True

    def bring_back(self) -> None:
        """Restart the process after an unexpected end.

        Raises
        ------
        ComponentFailed
            when the process keeps dying; the text ends with its last output.
        """
        if self.process is None:
            return
        self._deaths.append(time.monotonic())
        if len(self._deaths) > MAX_RESTARTS and self._deaths[-1] - self._deaths[0] < WITHIN_S:
            who = f"{self.name} (learner {self.label})" if self.label else self.name
            words = self.last_words()
            raise ComponentFailed(
                f"{who} died {len(self._deaths)} times, last with {_meaning(self.process.returncode)}; "
                + (f"its last output:\n{words}" if words else "it printed nothing")
            )
        self.left = False
        self.restarts += 1
        self.start("--restarted")

    def stop(self, timeout: float) -> None:
        """Terminate the process, and kill it if it still runs after `timeout` seconds."""
        if self.process is None:
            return
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(timeout)
            except subprocess.TimeoutExpired:
                print(
                    f"phototaxis: {self.name} did not end within {timeout:g} s and was killed",
                    file=sys.stderr,
                )
                self.process.kill()
                self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()

    def warnings(self) -> list[str]:
        """Return the warnings (`phototaxis.runtime.errors.warn`) in the log since the previous call."""
        try:
            with self._log.open("rb") as log:
                log.seek(self._read)
                written = log.read()
        except FileNotFoundError:
            return []
        whole = written[: written.rfind(b"\n") + 1]
        self._read += len(whole)
        lines = whole.decode(errors="replace").splitlines()
        return [line.removeprefix(WARNING) for line in lines if line.startswith(WARNING)]

    def last_words(self) -> str:
        """Return the last output before the process died; after a crash in compiled code, the place of the crash."""
        fatal = self.tail(100).rpartition("Fatal Python error")
        return "\n".join((fatal[1] + fatal[2]).splitlines()[:6]) if fatal[1] else self.tail(20)

    def fault(self) -> str:
        """Return the line in which the process explained its end (see `USER_ERRORS`), or "" if it gave none."""
        if self.process is None or self.process.returncode not in USER_ERRORS:
            return ""
        said = [line for line in self.tail(20).splitlines() if line.startswith(ERROR)]
        if said:
            return f"{self.name}: {said[-1].removeprefix(ERROR)}"
        return f"{self.name}: exit code {self.process.returncode}; {self._why_no_word()}"

    def _why_no_word(self) -> str:
        try:
            check_writable(self._log, "its log")
        except UserError as error:
            return str(error)
        return f"see {self._log}"

    def tail(self, lines: int) -> str:
        """Return the last `lines` lines of the log."""
        try:
            return "\n".join(self._log.read_text(errors="replace").splitlines()[-lines:])
        except FileNotFoundError:
            return ""


def _meaning(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}" if code else "exit code 0, before its time"
