"""Standard streams as a program needs them, whatever it was started with."""

import io
import os
import sys


def prepare() -> None:
    """Stand in for standard streams that are closed; write "?" for characters that a terminal or pipe does not have.

    Without a stand-in the next file or socket that is opened would get the number of the closed stream, and with it
    whatever libraries print.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))
        if number and isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors="replace")
