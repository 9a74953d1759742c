"""`phototaxis check`: tests a live agent against the contract, and compares generated files with the code."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import zenoh
from msgspec import Meta
from phototaxis.guard import exposure, rights
from phototaxis.guard.router import router_config, text
from phototaxis.runtime.disk import check_folder_writable, make_folder, write_atomic
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import parse
from phototaxis.runtime.session import BusOptions, WorldNames
from phototaxis.wire import document

ROUTER = "deploy/zenoh/router.json5"
WIRE = "docs/wire.md"
CERTS = Path("/etc/phototaxis/certs")
"""The folder in which the shipped configuration expects the files of `phototaxis certs`."""


class Options(BusOptions, kw_only=True):
    """Options of `phototaxis check`."""

    subject: Literal["agent", "rights", "wire"]
    """agent: test whether a live agent, in any language, follows the contract. rights: print which role may write and
    read what, and compare a router's configuration. wire: test whether the page about the wire format is up to date"""
    file: str = ""
    """rights, wire: the file to compare (default: the one in the repository)"""
    worlds: WorldNames = "phototaxis"
    """rights: names of the worlds, separated by commas"""
    write: bool = False
    """rights, wire: write the file instead of comparing it"""
    ticks: Annotated[int, Meta(ge=10, le=100_000)] = 200
    """agent: number of ticks that it must answer"""
    answer_timeout: Annotated[float, Meta(gt=0, le=600)] = 1.0
    """agent: seconds within which it must answer a tick"""
    agent_timeout: Annotated[float, Meta(gt=0, le=600)] = 20.0
    """agent: seconds to wait for an agent"""


def main(argv: Sequence[str]) -> int:
    about = "Check an agent, a router's rights, or the page about the wire format against the contract."
    options = parse(Options, argv, "phototaxis check", about, positional=["subject"])
    if options.subject == "agent":
        from phototaxis_lab.check_agent import check

        bus = BusOptions(**{field: getattr(options, field) for field in BusOptions.__struct_fields__})
        return check(bus, options.ticks, options.answer_timeout, options.agent_timeout)
    return _rights(options) if options.subject == "rights" else _wire(options)


def _rights(options: Options) -> int:
    worlds, file = options.worlds.split(","), Path(options.file or ROUTER)
    if options.write:
        config = router_config(worlds, ["tls/127.0.0.1:7447"], CERTS, "mtls")
        _put(file, text(config, "phototaxis check rights --write"))
        return 0
    print(rights.table())
    if not file.is_file():
        raise UserError(f"{file}: no such file; write it with: phototaxis check rights --write --file {file}")
    try:
        found = zenoh.Config.from_file(str(file))
        ours = zenoh.Config.from_json5(text(router_config(worlds, [], CERTS, "mtls"), ""))
        differing = [key for key in ("access_control", "low_pass_filter") if found.get_json(key) != ours.get_json(key)]
    except zenoh.ZError as error:
        raise UserError(f"{file}: not a Zenoh configuration: {str(error).splitlines()[0]}") from None
    if differing:
        raise UserError(
            f"{file}: {' and '.join(differing)} differ from the tables of topics and roles (worlds: {options.worlds}); "
            f"write it again with --write"
        )
    _refuse_gaps(file, found)
    print(f"{file} agrees with this table", file=sys.stderr)
    return 0


def _refuse_gaps(file: Path, found: zenoh.Config) -> None:
    """Raise UserError for a setting that lets strangers in, here or when Zenoh's own `zenohd` reads the file."""
    exposure.refuse_exposures(found, str(file))
    for key in exposure.DISCOVERY:
        if exposure.get(found, key) is None:
            raise UserError(f"{file}: {key} is left out, and zenohd turns it on; set it to false")


def _wire(options: Options) -> int:
    file = Path(options.file or WIRE)
    if options.write:
        _put(file, document.page())
    elif not file.is_file() or file.read_bytes() != document.page().encode():
        raise UserError(f"{file}: not up to date; write it again with: phototaxis check wire --write")
    else:
        print(f"{file} is up to date", file=sys.stderr)
    return 0


def _put(file: Path, content: str) -> None:
    check_folder_writable(file.parent, "--file")
    make_folder(file.parent)
    write_atomic(file, content.encode())
    print(file, file=sys.stderr)
