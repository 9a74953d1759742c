"""The program that shows recordings: where it is, and that it reports nothing."""

import os
from pathlib import Path

STARTS_WITHIN_S = 20.0
"""Seconds that it gets to start."""


def rerun_program() -> Path:
    """Rerun's own program; the script of the same name would leave it an orphan."""
    import rerun_cli

    return Path(rerun_cli.__file__).parent / "rerun"


def silence_rerun() -> None:
    """Keep Rerun, in this process and those that it starts, from reporting its use to its makers.

    It reports nothing where the variable CI is set; `FORCE_RERUN_ANALYTICS` overrules that.
    """
    os.environ.setdefault("CI", "true")
