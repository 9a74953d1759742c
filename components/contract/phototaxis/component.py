"""The common frame of every component process: session, bus, signals, one clear line on errors."""

import os
import secrets
import signal
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Annotated

from msgspec import Meta

from phototaxis.bus import Bus
from phototaxis.errors import one_line
from phototaxis.session import BusOptions, open_session, reaching


class ComponentOptions(BusOptions, kw_only=True):
    """Options that every component has."""

    tethered: bool = False
    """end when standard input closes, so that no process outlives the one that started it"""
    ident: Annotated[str, Meta(max_length=24, pattern=r"^[A-Za-z0-9_.-]*$")] = ""
    """its name on the bus, which nobody else may have (default: made up)"""
    restarted: bool = False
    """this process replaces one that died: continue from what that one left on disk, if anything"""


def run(role: str, options: ComponentOptions, serve: Callable[[Bus], None], label: str = "") -> None:
    """Open the bus as `role`, call `serve(bus)` and close everything, whatever happens.

    SIGTERM and SIGINT put a "stop" event into the inbox; `serve` returns on it.
    """
    ident = options.ident or made_up(label or role)
    with (
        open_session(role, options, ident) as session,
        Bus(session, options.name, role, ident, partial(reaching, session, options)) as bus,
    ):
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: bus.stop())
        if options.tethered:
            threading.Thread(target=_hold_tether, args=(bus,), daemon=True).start()
        serve(bus)


def made_up(label: str) -> str:
    """A name on the bus that is not taken."""
    return f"{label[:19]}-{secrets.token_hex(2)}"


def _hold_tether(bus: Bus) -> None:
    while os.read(sys.stdin.fileno(), 4096):
        pass
    bus.stop()


def entry(body: Callable[[], None]) -> None:
    """Run a component's main and exit with its code."""

    def main() -> int:
        body()
        return 0

    sys.exit(one_line(main))
