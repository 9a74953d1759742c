"""Errors that a user can act on, and how a command exits after them."""

import errno
import os
import select
import sys
import threading
from collections.abc import Callable
from typing import NoReturn, TextIO

from phototaxis.runtime import streams

EXIT_INTERRUPTED = 130
"""Exit code after Ctrl-C, the same as in shells (128 + SIGINT)."""
EXIT_READER_GONE = 141
"""Exit code when the reader of the output closes the pipe, as in `phototaxis status | head -1` (128 + SIGPIPE)."""
THREADS_END_WITHIN_S = 2.0
"""Seconds that the program waits for other threads when it ends."""


class UserError(Exception):
    """An error that the user can fix: one line says what is wrong, where, and what to do.

    The command prints ``phototaxis: error: LINE`` on stderr and exits with `exit_code`: 2 for unusable input, 3 for
    a peer or port that is not available and for a file that could not be saved, 4 for a component or a plug-in
    that fails.
    """

    exit_code = 2


class Unavailable(UserError):
    """A port, a bus or a peer is missing or in use, or a disk is full."""

    exit_code = 3


class ComponentFailed(UserError):
    """A process of the run keeps dying, or the code of a plug-in fails."""

    exit_code = 4


ERROR = "phototaxis: error: "
WARNING = "phototaxis: warning: "
_said: set[str] = set()


def warn(line: str) -> None:
    """Print ``phototaxis: warning: LINE`` on stderr, once per process: for input that is suspicious but allowed."""
    if line not in _said:
        _said.add(line)
        print(f"{WARNING}{line}", file=sys.stderr, flush=True)


def one_line(main: Callable[[], int]) -> int:
    """Run a command's body, flush its output, and return the exit code.

    A `UserError` becomes its one line and exit code, Ctrl-C becomes 130. When the reader closes the
    pipe, the command ends silently.
    """
    streams.prepare()
    try:
        return _body(main)
    except BrokenPipeError:
        if not _discard_unread_output():
            raise
        return EXIT_READER_GONE


def _body(main: Callable[[], int]) -> int:
    try:
        try:
            return main()
        except SystemExit as end:  # argparse has shown the help
            return int(end.code or 0)
        finally:
            sys.stdout.flush()
    except UserError as error:
        print(f"{ERROR}{error}", file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        where = error.filename or "the output"
        print(f"{ERROR}{where} cannot be written: {error.strerror}", file=sys.stderr, flush=True)
        return Unavailable.exit_code


def _discard_unread_output() -> bool:
    """Return whether a reader of our output is gone; if so, discard all output that is still buffered."""
    gone = [stream for stream in (sys.stdout, sys.stderr) if _reader_gone(stream)]
    if gone:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in gone:
            os.dup2(nowhere, stream.fileno())
    return bool(gone)


def _reader_gone(stream: TextIO) -> bool:
    watch = select.poll()
    watch.register(stream.fileno(), 0)
    return any(events & (select.POLLERR | select.POLLHUP) for _, events in watch.poll(0))


def leave(code: int) -> NoReturn:
    """End the program with `code`, even if a thread that a learner started is still running."""
    if _others():
        timer = threading.Timer(THREADS_END_WITHIN_S, _cut_short, [code])
        timer.daemon = True
        timer.start()
    sys.exit(code)


def _others() -> list[str]:
    """Names of the non-daemon threads, for which Python would wait at exit."""
    return [one.name for one in threading.enumerate() if not one.daemon and one is not threading.main_thread()]


def _cut_short(code: int) -> None:
    line = f"phototaxis: ended with {', '.join(_others())} still running; a learner's threads should be daemons"
    print(line, file=sys.stderr, flush=True)
    sys.stdout.flush()
    os._exit(code)
