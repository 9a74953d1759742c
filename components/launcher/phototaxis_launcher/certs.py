"""`phototaxis certs`: certificates, passwords and Zenoh configurations for a guarded router and its clients."""

import os
import secrets
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct
from phototaxis.guard.rights import subject
from phototaxis.guard.router import Auth, client_config, router_config, text
from phototaxis.runtime.disk import check_folder_writable, make_folder, write_failure
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import parse
from phototaxis.runtime.roles import ROLES
from phototaxis.runtime.session import WorldNames

MADE_BY = "phototaxis certs"


class Options(Struct, kw_only=True):
    """Options of `phototaxis certs`."""

    out: str = "certs"
    """folder to create; it must not exist yet"""
    worlds: WorldNames = "phototaxis"
    """names of the worlds, separated by commas"""
    host: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_.:-]+$", description="a host's name or address")] = "localhost"
    """name or IPv4 address at which the clients reach the router"""
    listen: Annotated[str, Meta(pattern=r"^[0-9a-fA-F.:]+$", description="an address in numbers")] = "127.0.0.1"
    """address that the router listens on; 0.0.0.0: all addresses of its machine"""
    port: Annotated[int, Meta(ge=1, le=65535)] = 7447
    """port of the router"""


def main(argv: Sequence[str]) -> int:
    about = (
        "Make a certificate authority for trials, a certificate and a password for every component, and Zenoh "
        "configurations for a router that accepts them and for its clients."
    )
    options = parse(Options, argv, "phototaxis certs", about)
    if ":" in options.host:
        raise UserError(f"--host {options.host}: Zenoh's TLS accepts only host names and IPv4 addresses; give one")
    folder = Path(options.out).resolve()
    if folder.exists():
        raise UserError(f"--out {options.out}: exists already; remove it or choose another folder")
    check_folder_writable(folder, "--out")
    make_folder(folder, 0o700)
    try:
        make(folder, list(dict.fromkeys(options.worlds.split(","))), options.host, options.listen, options.port)
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise write_failure(folder, error) from None
    print(
        f"{folder}: router-mtls.json5 and router-password.json5 for `phototaxis router --zenoh-config`, and for each "
        f"component WORLD.ROLE.mtls.json5 and WORLD.ROLE.password.json5 for its --zenoh-config",
        file=sys.stderr,
    )
    return 0


def make(folder: Path, worlds: Sequence[str], host: str, listen: str, port: int) -> None:
    """Write all files into an existing folder; only their owner can read them."""
    import trustme

    authority = trustme.CA(organization_name="Phototaxis trials")
    _write(folder / "ca.pem", authority.cert_pem.bytes())
    names = [subject(world, role) for world in worlds for role in ROLES]
    _certify(authority.issue_cert(*{host, "localhost", "127.0.0.1"}), folder, "router")
    passwords = {name: secrets.token_urlsafe(18) for name in names}
    _write(folder / "users.txt", "".join(f"{name}:{word}\n" for name, word in passwords.items()).encode())
    listen_at, connect_to = f"tls/{f'[{listen}]' if ':' in listen else listen}:{port}", f"tls/{host}:{port}"
    ways: tuple[Auth, ...] = ("mtls", "password")
    for auth in ways:
        config = router_config(worlds, [listen_at], folder, auth)
        _write(folder / f"router-{auth}.json5", text(config, MADE_BY).encode())
    for name in names:
        _certify(authority.issue_cert(f"{name}.example", common_name=name), folder, name)
        for auth in ways:
            config = client_config(connect_to, folder, name, auth, passwords[name])
            _write(folder / f"{name}.{auth}.json5", text(config, MADE_BY).encode())


def _certify(issued: Any, folder: Path, name: str) -> None:
    chain = b"".join(pem.bytes() for pem in issued.cert_chain_pems)
    _write(folder / f"{name}.pem", chain)
    _write(folder / f"{name}.key", issued.private_key_pem.bytes())


def _write(path: Path, content: bytes) -> None:
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(content)
