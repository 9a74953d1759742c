"""Child processes: started, watched, restarted when they die, and always ended."""

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
"""A component that dies more than RESTARTS times within this many seconds keeps dying."""
USER_ERRORS = {2: UserError, 3: Unavailable, 4: ComponentFailed}
"""Exit codes by which a component says in a line why it ends; it is not restarted, it would end the same."""


class Child:
    """One component process; its stderr goes to a file.

    It is tethered: when this process ends, however it ends, the child's standard input closes and the
    child leaves.

    Parameters
    ----------
    name : names its log file, and it in messages.
    module : Python module that is its program.
    label : if given, each start gets a name on the bus that begins with it.
    may_leave : whether it may end by itself, without an error; otherwise it is restarted then too.

    Attributes
    ----------
    idents : the names on the bus that it had, the newest last.
    left : it ended by itself, without an error.
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
        """Start the process in a session of its own, so that Ctrl-C reaches the launcher alone."""
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
                env=os.environ | {"PYTHONFAULTHANDLER": "1"},  # where a crash happened, in the log
            )

    def _open_log(self) -> IO[bytes]:
        try:
            return self._log.open("ab")
        except OSError as error:
            raise write_failure(self._log, error) from None

    def watch(self) -> bool:
        """Restart the process if it has died; whether it had to. One that may leave and did has `left`.

        Raises
        ------
        UserError, Unavailable, ComponentFailed
            when it ended with a line that says why.
        ComponentFailed
            also when it keeps dying; the text ends with its stderr.
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
        """Start it again after it has ended though it should not.

        Raises
        ------
        ComponentFailed
            when it keeps dying; the text ends with its stderr.
        """
        if self.process is None:
            return
        self._deaths.append(time.monotonic())
        if len(self._deaths) > MAX_RESTARTS and self._deaths[-1] - self._deaths[0] < WITHIN_S:
            who = f"{self.name} (learner {self.label})" if self.label else self.name
            words = self.last_words()
            raise ComponentFailed(
                f"{who} died {len(self._deaths)} times, last with {_meaning(self.process.returncode)}; "
                + (f"its last words:\n{words}" if words else "it said nothing")
            )
        self.left = False
        self.restarts += 1
        self.start("--restarted")

    def stop(self, timeout: float) -> None:
        """Ask the process to end, and end it when it does not within `timeout` seconds."""
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
        """The warnings (`phototaxis.runtime.errors.warn`) that it wrote since this was asked last."""
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
        """What it wrote before it died; of a crash in compiled code, where that was."""
        fatal = self.tail(100).rpartition("Fatal Python error")
        return "\n".join((fatal[1] + fatal[2]).splitlines()[:6]) if fatal[1] else self.tail(20)

    def fault(self) -> str:
        """The line with which it ended because of something that the user can mend; "" when it did not."""
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
        """The last lines it wrote."""
        try:
            return "\n".join(self._log.read_text(errors="replace").splitlines()[-lines:])
        except FileNotFoundError:
            return ""


def _meaning(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}" if code else "exit code 0, before its time"
