"""Opening a Zenoh session: from flags, a Zenoh config file, ZENOH_CONFIG, or this machine's own sockets."""

import fcntl
import getpass
import ipaddress
import json
import os
import re
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import msgspec
import zenoh
from msgspec import Meta, Struct

from phototaxis.errors import Unavailable, UserError
from phototaxis.topics import ROLES
from phototaxis.words import WORD


class BusOptions(Struct, kw_only=True):
    """Where the bus is. Without any of these: Unix sockets in a private folder of this machine."""

    name: Annotated[str, Meta(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_.-]+$", description=WORD)] = (
        "phototaxis"
    )
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
    if len(str(folder)) > 75:
        raise Unavailable(f"{folder} is too long for a Unix socket; set XDG_RUNTIME_DIR to a shorter folder")
    return folder


def local_config(role: str, name: str, ident: str) -> zenoh.Config:
    """Peers on this machine, linked by Unix sockets: no router, no multicast, no gossip, no network.

    Of agents there may be several, so each has a socket of its own.
    """
    folder = socket_folder(name)
    place = ROLES[role]
    if role == "agent":
        _sweep(folder)
    own = _agent_socket(folder, ident) if role == "agent" else folder / role
    return _config(
        "peer",
        listen=[f"unixsock-stream/{own}"] if place.listens else [],
        connect=[f"unixsock-stream/{folder}/{other}" for other in place.dials],
    )


def _agent_socket(folder: Path, ident: str) -> Path:
    return folder / f"agent-{ident}"


def _sweep(folder: Path) -> None:
    """Remove the sockets that killed agents left: nobody holds their locks."""
    for lock in folder.glob("agent-*.lock"):
        with lock.open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            lock.with_suffix("").unlink(missing_ok=True)
            lock.unlink(missing_ok=True)


@contextmanager
def reaching(own: zenoh.Session, options: BusOptions, ident: str) -> Iterator[zenoh.Session | None]:
    """A session in which the agent `ident` can be asked; None when it is not there.

    Through a router that is our `own`. Agents of this machine are not linked to each other, so there it is
    a passing one to that agent's socket.
    """
    if _elsewhere(options):
        yield own
        return
    socket = _agent_socket(socket_folder(options.name), ident)
    try:
        passing = zenoh.open(_config("client", [], [f"unixsock-stream/{socket}"])) if socket.exists() else None
    except zenoh.ZError:
        passing = None
    if passing is None:
        yield None
        return
    with passing:
        yield passing


def place(options: BusOptions) -> str:
    """Where the bus is, in words."""
    return f"through {found}" if (found := _elsewhere(options)) else "on this machine"


def _elsewhere(options: BusOptions) -> str:
    """The configuration file, or the first endpoint, that leads elsewhere than to this machine's own sockets."""
    return next(iter([*options.listen, *options.connect]), "") or _file(options)


def _file(options: BusOptions) -> str:
    return options.zenoh_config or os.environ.get("ZENOH_CONFIG", "")


def _config(mode: str, listen: list[str], connect: list[str]) -> zenoh.Config:
    retry = {"period_init_ms": 20, "period_max_ms": 100, "period_increase_factor": 1.5}
    block = {"wait_before_close": 500_000}
    settings = {
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
    try:
        return zenoh.Config.from_json5(json.dumps(settings))
    except zenoh.ZError as error:
        raise UserError(f"{_first_line(error)}; an endpoint is like tcp/127.0.0.1:7447") from None


def open_session(role: str, options: BusOptions, ident: str = "") -> zenoh.Session:
    """Open this component's session; `ident` is its name on the bus.

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
    if options.listen or options.connect:
        config = _config("peer" if options.listen else "client", options.listen, options.connect)
    elif _file(options):
        config = _from_file(_file(options))
    else:
        config = local_config(role, options.name, ident)
    _refuse_open_doors(config, options)
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        text = str(error)
        if "listener" in text and not _elsewhere(options):
            raise Unavailable(
                f"a {role} is already running in the world '{options.name}'; end it or choose another --name"
            ) from None
        where = _get(config, "connect/endpoints")
        who = f"; {where} may be down, or does not accept who we say we are" if "connect" in text and where else ""
        raise Unavailable(f"the bus cannot be opened: {_first_line(error)}{who}") from None


def open_router(options: BusOptions) -> zenoh.Session:
    """Open a Zenoh router: from `--listen`, or from a configuration file.

    Raises
    ------
    UserError, Unavailable
        as in `open_session`, and when neither is given.
    """
    if options.listen:
        config = _config("router", options.listen, options.connect)
    elif _file(options):
        config = _from_file(_file(options))
    else:
        raise UserError("a router needs --listen ENDPOINT, as in tcp/127.0.0.1:7447, or --zenoh-config FILE")
    if _get(config, "mode") != "router":
        raise UserError(f"{_file(options)}: not the configuration of a router: its mode is {_get(config, 'mode')}")
    _refuse_open_doors(config, options)
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise Unavailable(f"the router cannot be opened: {_first_line(error)}") from None


def _from_file(file: str) -> zenoh.Config:
    try:
        return zenoh.Config.from_file(file)
    except zenoh.ZError as error:
        raise UserError(f"{file}: not a Zenoh configuration: {_first_line(error)}") from None


def _get(config: zenoh.Config, key: str) -> Any:
    """A value of a configuration; None where there is none."""
    try:
        return msgspec.json.decode(config.get_json(key))
    except (zenoh.ZError, msgspec.DecodeError):
        return None


def listeners(config: zenoh.Config) -> list[str]:
    """The endpoints that a configuration listens on."""
    found = _get(config, "listen/endpoints")
    if isinstance(found, dict):
        found = found.get(_get(config, "mode") or "peer", [])
    return [item if isinstance(item, str) else item.get("endpoint", "") for item in found or []]


def _guarded(config: zenoh.Config) -> bool:
    """Whether who comes in must say who they are, and may only do what they are allowed to."""
    certificates = _get(config, "transport/link/tls/enable_mtls")
    passwords = _get(config, "transport/auth/usrpwd/dictionary_file")
    may = _get(config, "access_control") or {}
    return bool((certificates or passwords) and may.get("enabled") and may.get("default_permission") == "deny")


def _refuse_open_doors(config: zenoh.Config, options: BusOptions) -> None:
    if not options.insecure and not _guarded(config):
        for endpoint in listeners(config):
            refuse_open_door(endpoint)


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
            f"{endpoint} listens beyond this machine and nothing guards it; use 127.0.0.1, or a router with "
            f"credentials (phototaxis certs), or add --insecure"
        )


def _first_line(error: Exception) -> str:
    """Zenoh's own words without the source locations of its Rust code."""
    return re.sub(r" at \S+\.rs:\d+\.?", "", str(error)).splitlines()[0]
