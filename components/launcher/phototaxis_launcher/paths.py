"""Where everything of a run is, and how to look at it again."""

import os
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any


def run_paths(result: dict[str, Any]) -> list[str]:
    """Where everything of a run is, and how to look at it again, in lines for a person."""
    lines = []
    if recording := result["recording"]:
        lines += [f"recording   {recording}", f"            look again: {program()} view {shown(recording)}"]
    if checkpoint := result["checkpoint"]:
        lines += [f"checkpoint  {checkpoint}", f"            measure it: {program()} evaluate {shown(checkpoint)}"]
    elif drivers := result["drivers"]:
        lines.append(f"checkpoint  none: {drivers[-1]['driver']} drove last, and saved none here")
    return lines


def program() -> str:
    """How this program is called from here."""
    own = Path(sys.executable).parent / "phototaxis"
    return "phototaxis" if shutil.which("phototaxis") == str(own) or not own.exists() else shown(str(own))


def shown(file: str) -> str:
    """A file's path as a person at this place would type it."""
    return shlex.quote(min(file, os.path.relpath(file), key=len))
