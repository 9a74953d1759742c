"""Where the live view is found, and the program that shows it."""

import os
from pathlib import Path


def viewer_url(web_port: int, grpc_port: int) -> str:
    """The whole address of the web viewer on this machine, already connected to the recording."""
    return f"http://localhost:{web_port}/?url=rerun%2Bhttp%3A%2F%2Flocalhost%3A{grpc_port}%2Fproxy"


def rerun_program() -> Path:
    """Rerun's own program; the script of the same name would leave it an orphan."""
    import rerun_cli

    return Path(rerun_cli.__file__).parent / "rerun"


def silence_rerun() -> None:
    """Keep Rerun, in this process and those that it starts, from reporting its use to its makers.

    It reports nothing where the variable CI is set; `FORCE_RERUN_ANALYTICS` overrules that.
    """
    os.environ.setdefault("CI", "true")
