"""Where the live view is found, and the program that shows it."""

from pathlib import Path


def viewer_url(web_port: int, grpc_port: int) -> str:
    """The whole address of the web viewer on this machine, already connected to the recording."""
    return f"http://localhost:{web_port}/?url=rerun%2Bhttp%3A%2F%2Flocalhost%3A{grpc_port}%2Fproxy"


def rerun_program() -> Path:
    """Rerun's own program; the script of the same name would leave it an orphan."""
    import rerun_cli

    return Path(rerun_cli.__file__).parent / "rerun"
