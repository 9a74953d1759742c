"""Finds Rerun's viewer program, and turns its usage reports off."""

import os
from pathlib import Path

STARTS_WITHIN_S = 20.0
"""Seconds in which the viewer must start."""


def rerun_program() -> Path:
    """Return the path of Rerun's own program; ending the script of the same name would leave the program running."""
    import rerun_cli

    return Path(rerun_cli.__file__).parent / "rerun"


def silence_rerun() -> None:
    """Keep Rerun, in this process and its children, from reporting its use to its makers.

    Rerun reports nothing if the environment variable CI is set; `FORCE_RERUN_ANALYTICS` overrides that.
    """
    os.environ.setdefault("CI", "true")
