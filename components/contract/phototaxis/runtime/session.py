"""Opening a Zenoh session: from flags, a Zenoh config file, ZENOH_CONFIG, or this machine's own sockets."""

import json
import os
import re
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Annotated

import zenoh
from msgspec import Meta, Struct

from phototaxis.guard import exposure
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.roles import ROLES
from phototaxis.runtime.sockets import agent_socket, in_use, remove_stale_sockets, socket_folder, startup_lock

_WORLD = r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,39}"
_FORM = "up to 40 letters, digits, '_', '.' and '-', the first none of the last two"
WorldName = Annotated[str, Meta(pattern=rf"^{_WORLD}\Z", description=_FORM)]
"""A world's name. It is part of keys, folders and file names, so it cannot be ".." or begin with a dash."""
WorldNames = Annotated[
    str, Meta(pattern=rf"^{_WORLD}(,{_WORLD})*\Z", description=f"names with commas between them, each {_FORM}")
]
"""Several worlds, separated by commas."""
ATTEMPT_S = 1.0
"""Seconds that one attempt to reach a router takes while we wait for it."""


class BusOptions(Struct, kw_only=True):
    """Where the bus is; by default Unix sockets in a private folder on this machine."""

    name: WorldName = "phototaxis"
    """name of the world on the bus, the prefix of its keys; components of one world share it"""
    listen: list[str] = []
    """endpoint to listen on, such as tcp/127.0.0.1:7447 (may be repeated)"""
    connect: list[str] = []
    """endpoint to connect to, such as tcp/127.0.0.1:7447 (may be repeated)"""
    zenoh_config: str = ""
    """a Zenoh configuration file (JSON5); the variable ZENOH_CONFIG names one too"""
    insecure: bool = False
    """allow listening on addresses other than this machine's own"""
    wait: Annotated[float, Meta(ge=0)] = 0.0
    """seconds to wait for a router that cannot be reached yet"""


def local_config(role: str, name: str, ident: str) -> zenoh.Config:
    """Peers on this machine, linked by Unix sockets: no router, no multicast, no gossip, no network.

    There may be several agents, so each has a socket of its own.
    """
    folder, links = socket_folder(name), ROLES[role]
    return _config(
        "peer",
        listen=[f"unixsock-stream/{_own_socket(folder, role, ident)}"] if links.listens else [],
        connect=[f"unixsock-stream/{folder}/{other}" for other in links.dials],
    )


def _own_socket(folder: Path, role: str, ident: str) -> Path:
    return agent_socket(folder, ident) if role == "agent" else folder / role


@contextmanager
def agent_session(own: zenoh.Session, options: BusOptions, ident: str) -> Generator[zenoh.Session | None]:
    """Open a session that reaches the agent `ident`; None when that agent is absent.

    With a router our `own` session reaches it. Agents on one machine are not linked to each other, so without a
    router this is a temporary session to the agent's socket.
    """
    if _elsewhere(options):
        yield own
        return
    socket = agent_socket(socket_folder(options.name), ident)
    try:
        passing = zenoh.open(_config("client", [], [f"unixsock-stream/{socket}"])) if socket.exists() else None
    except zenoh.ZError:
        passing = None
    if passing is None:
        yield None
        return
    with passing:
        yield passing


def bus_location(options: BusOptions) -> str:
    """Describe where the bus is, for people."""
    return f"through {found}" if (found := _elsewhere(options)) else "on this machine"


def _elsewhere(options: BusOptions) -> str:
    """The configuration file or the first endpoint that is used instead of this machine's sockets; "" for neither."""
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

    The first that is given decides: `--listen` or `--connect`, `--zenoh-config`, ZENOH_CONFIG, the sockets of this
    machine. With `--connect` alone the component is a client (of a router, or of a listening peer); with `--listen`
    it is a peer. `--wait` sets how long it tries to connect.

    Raises
    ------
    UserError
        for a configuration that cannot be read, or that lets strangers in without `--insecure`.
    Unavailable
        when an endpoint is in use or cannot be reached.
    """
    if not _elsewhere(options):
        return _open_local(role, options.name, ident)
    if options.listen or options.connect:
        config = _from_flags("peer" if options.listen else "client", options)
    else:
        config = _from_file(options)
    try:
        return _open(config, options.wait)
    except zenoh.ZError as error:
        where = exposure.get(config, "connect/endpoints")
        who = f"; {where} may be down, or rejected our credentials" if _unreachable(error) and where else ""
        raise Unavailable(f"the bus cannot be opened: {_first_line(error)}{who}") from None


def open_router(options: BusOptions) -> zenoh.Session:
    """Open a Zenoh router: from `--listen`, or from a configuration file.

    Raises
    ------
    UserError, Unavailable
        as in `open_session`, and when neither is given.
    """
    if options.listen:
        config = _from_flags("router", options)
    elif _file(options):
        config = _from_file(options)
    else:
        raise UserError("a router needs --listen ENDPOINT, as in tcp/127.0.0.1:7447, or --zenoh-config FILE")
    mode = exposure.get(config, "mode")
    if mode != "router":
        raise UserError(f"{_file(options)}: not the configuration of a router: its mode is {mode or 'left out'}")
    if not exposure.endpoints(config, "listen"):
        raise UserError(f"{_file(options)}: names no endpoint to listen on, such as tcp/127.0.0.1:7447")
    try:
        return _open(config, options.wait)
    except zenoh.ZError as error:
        raise Unavailable(f"the router cannot be opened: {_first_line(error)}") from None


def _open_local(role: str, name: str, ident: str) -> zenoh.Session:
    """A session on this machine's own sockets."""
    config, folder = local_config(role, name, ident), socket_folder(name)
    with startup_lock(folder) if role == "agent" else nullcontext():
        if role == "agent":
            remove_stale_sockets(folder)
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if not ROLES[role].listens or not in_use(_own_socket(folder, role, ident)):
                raise Unavailable(f"the bus cannot be opened: {_first_line(error)}") from None
    if role == "agent":
        raise Unavailable(f"an agent '{ident}' is already running in the world '{name}'; choose another --ident")
    who = "phototaxis up" if role == "launcher" else f"a {role}"
    raise Unavailable(f"{who} is already running in the world '{name}'; end it or choose another --name")


def _open(config: zenoh.Config, wait: float) -> zenoh.Session:
    """Open a session; while its router cannot be reached, try again for `wait` seconds, with a line on stderr.

    Raises
    ------
    zenoh.ZError
        when the last attempt fails.
    """
    if not wait:
        return zenoh.open(config)
    deadline, told = time.monotonic() + wait, False
    exposure.put(config, "connect/timeout_ms", round(1000 * min(wait, ATTEMPT_S)))
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if not _unreachable(error):
                raise
            if not told:
                where = ", ".join(map(str, exposure.endpoints(config, "connect")))
                print(f"waiting up to {wait:g} s for {where}", file=sys.stderr, flush=True)
                told = True
            if time.monotonic() >= deadline:
                raise


def _unreachable(error: zenoh.ZError) -> bool:
    return "Unable to connect" in str(error)


def _from_flags(mode: str, options: BusOptions) -> zenoh.Config:
    config = _config(mode, options.listen, options.connect)
    if not options.insecure:
        exposure.refuse_exposures(config)
    return config


def _from_file(options: BusOptions) -> zenoh.Config:
    """Read a configuration from a file, and disable everything that the file does not enable itself."""
    file = _file(options)
    try:
        config = zenoh.Config.from_file(file)
    except zenoh.ZError as error:
        raise UserError(f"{file}: not a Zenoh configuration: {_first_line(error)}") from None
    exposure.close_defaults(config)
    if not options.insecure:
        exposure.refuse_exposures(config, file)
    if not any(exposure.endpoints(config, what) for what in ("listen", "connect")):
        raise UserError(f"{file}: names no endpoint to listen on or to connect to, such as tcp/127.0.0.1:7447")
    return config


def _first_line(error: Exception) -> str:
    """The first line of Zenoh's error text, without source locations in its Rust code."""
    return re.sub(r" at \S+\.rs:\d+\.?", "", str(error)).splitlines()[0]
