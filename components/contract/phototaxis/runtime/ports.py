"""Finds free ports on this machine, and makes the address of the live view."""

import os
import socket
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from phototaxis.runtime.errors import Unavailable


def free_ports(count: int) -> list[int]:
    """`count` different ports of the loopback interface."""
    return find_ports("127.0.0.1", {str(number): 0 for number in range(count)})


def find_ports(host: str, wanted: Mapping[str, int]) -> list[int]:
    """Find a TCP port for each option: the given one if it is free, any free one for 0, and −1 for −1.

    Each port stays bound until all are found, so that no two options get the same one.

    Raises
    ------
    Unavailable
        when a port is taken, by a process or by another of the options.
    """
    found: list[int] = []
    with ExitStack() as held:
        for flag, port in wanted.items():
            if port < 0:
                found.append(port)
                continue
            try:
                server = held.enter_context(socket.create_server((host, port)))
            except OSError as error:
                why = _holder(port) or os.strerror(error.errno or 0)
                raise Unavailable(
                    f"port {port} on {host} is not free ({why}); choose another with {flag} (0: any free one)"
                ) from None
            found.append(server.getsockname()[1])
    return found


def viewer_url(web_port: int, grpc_port: int) -> str:
    """The whole address of the web viewer on this machine, already connected to the recording."""
    return f"http://localhost:{web_port}/?url=rerun%2Bhttp%3A%2F%2Flocalhost%3A{grpc_port}%2Fproxy"


def _holder(port: int) -> str:
    """Describe the process that listens on a port; "" if this user may not see it."""
    try:
        import psutil
    except ModuleNotFoundError:
        return ""
    try:
        listening = [one for one in psutil.net_connections("tcp") if one.status == psutil.CONN_LISTEN and one.laddr]
        pids = [one.pid for one in listening if one.laddr[1:] == (port,)]
        if os.getpid() in pids:
            return "another option names it too"
        words = psutil.Process(pids[0]).cmdline() if pids and pids[0] else []
    except psutil.Error:
        return ""
    if words:
        return f"process {pids[0]} listens there: {' '.join([Path(words[0]).name, *words[1:3]])}"
    return "a process of another user listens there" if pids else ""
