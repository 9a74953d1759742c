"""Errors that a person can act on, and how a command ends on them."""

import errno
import io
import os
import select
import sys
from collections.abc import Callable
from typing import TextIO

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""
READER_GONE = 141
"""Exit code when whoever read the output closed it, as in `phototaxis status | head -1`."""


class UserError(Exception):
    """Something the user can mend: one line that says what, where and what to do.

    A command that meets one prints ``phototaxis: error: LINE`` on stderr and exits with `exit_code`:
    2 for input that cannot be used, 3 for a peer or a port that is not available, 4 for a component
    that keeps failing.
    """

    exit_code = 2


class Unavailable(UserError):
    """A port, a bus or a peer is missing or taken."""

    exit_code = 3


class ComponentFailed(UserError):
    """A process of the run keeps dying."""

    exit_code = 4


def one_line(main: Callable[[], int]) -> int:
    """Run a command's body to its last byte of output; the exit code.

    A `UserError` becomes its one line and exit code, Ctrl-C becomes 130. A reader that closed the pipe ends the
    command without a word. A terminal that lacks a character shows a question mark in its place.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        return _body(main)
    except BrokenPipeError:
        if not _discard_unread_output():
            raise
        return READER_GONE


def _body(main: Callable[[], int]) -> int:
    try:
        try:
            return main()
        except SystemExit as end:  # argparse has shown the help
            return int(end.code or 0)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except UserError as error:
        print(f"phototaxis: error: {error}", file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        print(f"phototaxis: error: the output cannot be written: {error.strerror}", file=sys.stderr, flush=True)
        return Unavailable.exit_code


def _discard_unread_output() -> bool:
    """Whether a reader of our output is gone; if so, what is still buffered goes nowhere, also at the end."""
    gone = [stream for stream in (sys.stdout, sys.stderr) if stream is not None and _reader_gone(stream)]
    if gone:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in gone:
            os.dup2(nowhere, stream.fileno())
    return bool(gone)


def _reader_gone(stream: TextIO) -> bool:
    watch = select.poll()
    watch.register(stream.fileno(), 0)
    return any(events & (select.POLLERR | select.POLLHUP) for _, events in watch.poll(0))
