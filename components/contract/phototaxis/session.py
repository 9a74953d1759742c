"""Opening a Zenoh session: from flags, a Zenoh config file, ZENOH_CONFIG, or this machine's own sockets."""

import getpass
import ipaddress
import json
import os
import re
import stat
import tempfile
from pathlib import Path
from typing import Annotated

import msgspec
import zenoh
from msgspec import Meta, Struct

from phototaxis.errors import Unavailable, UserError
from phototaxis.topics import ROLES


class BusOptions(Struct, kw_only=True):
    """Where the bus is. Without any of these: Unix sockets in a private folder of this machine."""

    name: Annotated[str, Meta(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_.-]+$")] = "phototaxis"
    """name of the world on the bus, the prefix of its keys; components of one world share it"""
    listen: list[str] = []
    """endpoint to listen on, such as tcp/127.0.0.1:7447 (may be repeated)"""
    connect: list[str] = []
    """endpoint to connect to, such as tcp/127.0.0.1:7447 (may be repeated)"""
    zenoh_config: str = ""
    """a Zenoh configuration file (JSON5); the variable ZENOH_CONFIG names one too"""
    insecure: bool = False
    """allow listening on addresses other than this machine's own"""


def socket_folder(name: str) -> Path:
    """The private folder (mode 0700) that holds the Unix sockets of one world; made where missing.

    Raises
    ------
    Unavailable
        when the folder belongs to somebody else or others may enter it.
    """
    base = os.environ.get("XDG_RUNTIME_DIR")
    root = Path(base) / "phototaxis" if base else Path(tempfile.gettempdir()) / f"phototaxis-{getpass.getuser()}"
    folder = root / name
    for part in (root, folder):
        part.mkdir(mode=0o700, parents=True, exist_ok=True)
        info = part.lstat()
        if not stat.S_ISDIR(info.st_mode) or info.st_uid != os.getuid() or info.st_mode & 0o077:
            raise Unavailable(f"{part} is not a private folder of this user; remove it or set XDG_RUNTIME_DIR")
    if len(str(folder)) > 90:
        raise Unavailable(f"{folder} is too long for a Unix socket; set XDG_RUNTIME_DIR to a shorter folder")
    return folder


def local_config(role: str, name: str) -> zenoh.Config:
    """Peers on this machine, linked by Unix sockets: no router, no multicast, no gossip, no network."""
    folder = socket_folder(name)
    place = ROLES[role]
    return _config(
        "peer",
        listen=[f"unixsock-stream/{folder}/{role}"] if place.listens else [],
        connect=[f"unixsock-stream/{folder}/{other}" for other in place.dials],
    )


def _config(mode: str, listen: list[str], connect: list[str]) -> zenoh.Config:
    retry = {"period_init_ms": 20, "period_max_ms": 100, "period_increase_factor": 1.5}
    block = {"wait_before_close": 500_000}
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": mode,
                "listen": {"endpoints": listen},
                "connect": {
                    "endpoints": connect,
                    "timeout_ms": 5_000 if mode == "client" else -1,
                    "exit_on_failure": mode == "client",
                    "retry": retry,
                },
                "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}, "delay": 0},
                "transport": {
                    "unicast": {"qos": {"enabled": mode != "peer"}},
                    "shared_memory": {"enabled": False},
                    "link": {"tx": {"lease": 1000, "queue": {"congestion_control": {"block": block}}}},
                },
            }
        )
    )


def open_session(role: str, options: BusOptions) -> zenoh.Session:
    """Open this component's session.

    `--listen` and `--connect` win over `--zenoh-config`, that over ZENOH_CONFIG, and that over the
    sockets of this machine. With `--connect` alone the component is a client (of a router, or of a
    listening peer); with `--listen` a peer.

    Raises
    ------
    UserError
        for a configuration that cannot be read, or a listener beyond this machine without `--insecure`.
    Unavailable
        when an endpoint is taken or cannot be reached.
    """
    file = options.zenoh_config or os.environ.get("ZENOH_CONFIG", "")
    if options.listen or options.connect:
        mode = "router" if role == "router" else "peer" if options.listen else "client"
        config = _config(mode, options.listen, options.connect)
    elif file:
        try:
            config = zenoh.Config.from_file(file)
        except zenoh.ZError as error:
            raise UserError(f"{file}: not a Zenoh configuration: {_first_line(error)}") from None
    else:
        config = local_config(role, options.name)
    if not options.insecure:
        for endpoint in _listeners(config):
            refuse_open_door(endpoint)
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        text = str(error)
        if "listener" in text and not (options.listen or options.connect or file):
            raise Unavailable(
                f"a {role} is already running in the world '{options.name}'; end it or choose another --name"
            ) from None
        raise Unavailable(f"the bus cannot be opened: {_first_line(error)}") from None


def _listeners(config: zenoh.Config) -> list[str]:
    try:
        found = msgspec.json.decode(config.get_json("listen/endpoints"))
    except (zenoh.ZError, msgspec.DecodeError):
        return []
    if isinstance(found, dict):
        mode = msgspec.json.decode(config.get_json("mode")) or "peer"
        found = found.get(mode, [])
    return [item if isinstance(item, str) else item.get("endpoint", "") for item in found or []]


def refuse_open_door(endpoint: str) -> None:
    """Raise UserError unless the endpoint is a Unix socket or a loopback address."""
    protocol, _, address = endpoint.partition("/")
    if protocol.startswith("unix"):
        return
    host = address.split("#")[0].rpartition(":")[0].strip("[]")
    try:
        local = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        local = False
    if not local:
        raise UserError(
            f"{endpoint} listens beyond this machine and nothing guards it; use 127.0.0.1, or add --insecure"
        )


def _first_line(error: Exception) -> str:
    """Zenoh's own words without the source locations of its Rust code."""
    return re.sub(r" at \S+\.rs:\d+\.?", "", str(error)).splitlines()[0]
