"""Zenoh configurations for a guarded bus: one router, everyone else its client."""

import json
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any, Literal

from phototaxis.guard import rights

Auth = Literal["mtls", "password"]
"""How components authenticate: by certificate, or by user name and password. TLS encrypts both."""

NO_SCOUTING = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}


def router_config(worlds: Sequence[str], listen: Sequence[str], folder: PurePath, auth: Auth) -> dict[str, Any]:
    """The Zenoh configuration of the router.

    Parameters
    ----------
    worlds : names of the worlds that may be on its bus.
    listen : endpoints of the router, such as tls/0.0.0.0:7447.
    folder : where `phototaxis certs` put ca.pem, router.pem, router.key and users.txt.
    auth : how components authenticate.
    """
    tls = {
        "root_ca_certificate": str(folder / "ca.pem"),
        "listen_certificate": str(folder / "router.pem"),
        "listen_private_key": str(folder / "router.key"),
        "enable_mtls": auth == "mtls",
    }
    transport: dict[str, Any] = {"link": {"tls": tls}}
    if auth == "password":
        transport["auth"] = {"usrpwd": {"dictionary_file": str(folder / "users.txt")}}
    return {
        "mode": "router",
        "listen": {"endpoints": list(listen)},
        "scouting": NO_SCOUTING,
        "transport": transport,
        "access_control": rights.access_control(worlds),
        "low_pass_filter": rights.low_pass_filter(worlds),
    }


def client_config(connect: str, folder: PurePath, name: str, auth: Auth, password: str = "") -> dict[str, Any]:
    """The Zenoh configuration of one component, whose name at the router is `name` (WORLD.ROLE)."""
    tls = {"root_ca_certificate": str(folder / "ca.pem"), "verify_name_on_connect": True}
    transport: dict[str, Any] = {"link": {"tls": tls, "tx": {"lease": 1000}}}
    if auth == "mtls":
        tls |= {
            "connect_certificate": str(folder / f"{name}.pem"),
            "connect_private_key": str(folder / f"{name}.key"),
            "enable_mtls": True,
        }
    else:
        transport["auth"] = {"usrpwd": {"user": name, "password": password}}
    return {
        "mode": "client",
        "connect": {"endpoints": [connect], "timeout_ms": 5000, "exit_on_failure": True},
        "scouting": NO_SCOUTING,
        "transport": transport,
    }


def text(config: dict[str, Any], made_by: str) -> str:
    """A configuration as a JSON5 file that says where it comes from."""
    return f"// Made by: {made_by}\n{json.dumps(config, indent=1)}\n"
