"""Errors that a person can act on, and how a command ends on them."""

import os
import sys
import threading
from collections.abc import Callable
from typing import NoReturn

from phototaxis import streams

LEAVE_WITHIN = 2.0
"""Seconds that threads get to end when the program ends."""


class UserError(Exception):
    """Something the user can mend: one line that says what, where and what to do.

    A command that meets one prints ``phototaxis: error: LINE`` on stderr and exits with `exit_code`:
    2 for input that cannot be used, 3 for a peer or a port that is not available, 4 for a component
    that keeps failing, or a learner's own code.
    """

    exit_code = 2


class Unavailable(UserError):
    """A port, a bus or a peer is missing or taken."""

    exit_code = 3


class ComponentFailed(UserError):
    """A process of the run keeps dying, or code that somebody brought along fails."""

    exit_code = 4


ERROR = "phototaxis: error: "
WARNING = "phototaxis: warning: "
_said: set[str] = set()


def warn(line: str) -> None:
    """Print ``phototaxis: warning: LINE`` on stderr, once in a process: for what may be meant as it is."""
    if line not in _said:
        _said.add(line)
        print(f"{WARNING}{line}", file=sys.stderr, flush=True)


def one_line(main: Callable[[], int]) -> int:
    """Run a command's body; a `UserError` becomes its one line and exit code, Ctrl-C becomes 130."""
    streams.prepare()
    try:
        return main()
    except UserError as error:
        print(f"{ERROR}{error}", file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        return 130


def leave(code: int) -> NoReturn:
    """End the program with `code`, also when a thread that a learner left behind would keep it alive."""
    if _others():
        timer = threading.Timer(LEAVE_WITHIN, _cut_short, [code])
        timer.daemon = True
        timer.start()
    sys.exit(code)


def _others() -> list[str]:
    """Names of the threads that Python waits for before it ends."""
    return [one.name for one in threading.enumerate() if not one.daemon and one is not threading.main_thread()]


def _cut_short(code: int) -> None:
    line = f"phototaxis: ended with {', '.join(_others())} still running; a learner's threads should be daemons"
    print(line, file=sys.stderr, flush=True)
    sys.stdout.flush()
    os._exit(code)
