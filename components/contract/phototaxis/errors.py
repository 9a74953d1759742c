"""Errors that a person can act on, and how a command ends on them."""

import sys
from collections.abc import Callable

from phototaxis import streams


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
    """Run a command's body; a `UserError` becomes its one line and exit code, Ctrl-C becomes 130."""
    streams.prepare()
    try:
        return main()
    except UserError as error:
        print(f"phototaxis: error: {error}", file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        return 130
