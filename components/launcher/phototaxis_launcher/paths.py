"""Tells a person where the files of a run are, and how to look at them again."""

import os
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any


def run_paths(result: dict[str, Any]) -> list[str]:
    """Return lines for a person: the files of a run, and the commands that open them."""
    lines = []
    if recording := result["recording"]:
        lines += [f"recording   {recording}", f"            look again: {program()} view {shown(recording)}"]
    if checkpoint := result["checkpoint"]:
        lines += [f"checkpoint  {checkpoint}", f"            measure it: {program()} evaluate {shown(checkpoint)}"]
    elif drivers := result["drivers"]:
        lines.append(f"checkpoint  none: {drivers[-1]['driver']} drove last, and saved none here")
    return lines


def program() -> str:
    """Return the command that calls this program: `phototaxis` if it is on the PATH, else its path."""
    own = Path(sys.executable).parent / "phototaxis"
    return "phototaxis" if shutil.which("phototaxis") == str(own) or not own.exists() else shown(str(own))


def shown(file: str) -> str:
    """Return the path of a file as a person types it here: the shorter of relative and absolute."""
    return shlex.quote(min(file, os.path.relpath(file), key=len))
