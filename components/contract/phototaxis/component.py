"""The common frame of every component process: session, bus, signals, one clear line on errors."""

import os
import secrets
import signal
import sys
import threading
from collections.abc import Callable
from typing import Annotated

from msgspec import Meta

from phototaxis.bus import Bus
from phototaxis.errors import one_line
from phototaxis.session import BusOptions, open_session


class ComponentOptions(BusOptions, kw_only=True):
    """Options that every component has."""

    id: Annotated[str, Meta(max_length=40, pattern=r"^[A-Za-z0-9_.-]*$")] = ""
    """a word of your choice in this component's name on the bus, by which `phototaxis health` finds it"""
    tethered: bool = False
    """end when standard input closes, so that no process outlives the one that started it"""
    restarted: bool = False
    """this process replaces one that died: continue from what that one left on disk, if anything"""


def run(role: str, options: ComponentOptions, serve: Callable[[Bus], None], label: str = "") -> None:
    """Open the bus as `role`, call `serve(bus)` and close everything, whatever happens.

    SIGTERM and SIGINT put a "stop" event into the inbox; `serve` returns on it.
    """
    ident = "-".join(filter(None, (label or role, options.id, secrets.token_hex(2))))
    with open_session(role, options) as session, Bus(session, options.name, role, ident) as bus:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: bus.stop())
        if options.tethered:
            threading.Thread(target=_hold_tether, args=(bus,), daemon=True).start()
        serve(bus)


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
