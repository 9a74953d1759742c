"""The common frame of every component process: session, bus, signals, one clear line on errors."""

import os
import secrets
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack
from functools import partial
from typing import Annotated

import msgspec
from msgspec import Meta

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.errors import ComponentFailed, UserError, leave, one_line
from phototaxis.runtime.phrases import WORD
from phototaxis.runtime.roles import ROLES
from phototaxis.runtime.session import BusOptions, agent_session, bus_location, open_session

ORDERLY_END_S = 60.0
"""Seconds that a component gets to end in good order when the process that it is tethered to is gone."""


class ComponentOptions(BusOptions, kw_only=True):
    """Options that every component has."""

    tethered: bool = False
    """end when standard input closes, so that no process outlives the one that started it"""
    label: Annotated[str, Meta(max_length=40, pattern=r"^[A-Za-z0-9_.-]*$", description=WORD, examples=["robot-1"])] = (
        ""
    )
    """a word in its made-up name on the bus, by which `phototaxis health` finds it"""
    ident: Annotated[str, Meta(max_length=24, pattern=r"^[A-Za-z0-9_.-]*$", description=WORD, examples=["robot-1"])] = (
        ""
    )
    """its whole name on the bus, which nobody else may have or have had (default: made up)"""
    restarted: bool = False
    """this process replaces one that died: continue from what that one left on disk, if anything"""


def run(
    role: str, options: ComponentOptions, serve: Callable[[Bus], None], kind: str = "", worlds: Sequence[str] = ()
) -> None:
    """Open the bus as `role`, call `serve(bus)` and close everything, whatever happens.

    SIGTERM and SIGINT put a "stop" event into the inbox; `serve` returns on it. With several `worlds` in
    place of `options.name`, each is served in a thread of its own; the first error ends all of them.

    Raises
    ------
    KeyboardInterrupt
        when all is closed after SIGINT, so that the exit code says so.
    """
    ident = options.ident or unique_name(kind or role, options.label)
    with ExitStack() as stack:
        buses: list[Bus] = []
        for name in worlds or [options.name]:
            own = msgspec.structs.replace(options, name=name)
            session = stack.enter_context(open_session(role, own, ident))
            buses.append(stack.enter_context(Bus(session, name, role, ident, partial(agent_session, session, own))))
            line = f"{ident}: {role} of the world '{name}', {bus_location(own)}; waits for {ROLES[role].waits_for}"
            print(line, file=sys.stderr, flush=True)
        stop, signals = partial(_stop, buses), list[int]()
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda number, _: (signals.append(number), stop()))
        if options.tethered:
            threading.Thread(target=_hold_tether, args=(stop,), daemon=True).start()
        _serve(buses, serve, stop)
    if signal.SIGINT in signals:
        raise KeyboardInterrupt


def _serve(buses: Sequence[Bus], serve: Callable[[Bus], None], stop: Callable[[], None]) -> None:
    """Serve one bus here, or each of several in a thread of its own."""
    if len(buses) == 1:
        serve(buses[0])
        return
    with ThreadPoolExecutor(len(buses)) as pool:
        served = [pool.submit(serve, bus) for bus in buses]
        while wait(served, timeout=0.2).not_done:  # and signals are looked for
            if any(one.done() and one.exception() for one in served):
                stop()
    for one in served:
        one.result()


def _stop(buses: Sequence[Bus]) -> None:
    for bus in buses:
        bus.stop()


def unique_name(kind: str, label: str = "") -> str:
    """A name on the bus that nobody else has: many may start at the same moment."""
    return "-".join(filter(None, (kind[:15], label, secrets.token_hex(4))))


def _hold_tether(stop: Callable[[], None]) -> None:
    """Leave when standard input closes: in good order, or without it when code of others does not return."""
    while os.read(sys.stdin.fileno(), 4096):
        pass
    stop()
    time.sleep(ORDERLY_END_S)  # a process that ends in the meantime does not wait for this thread
    os._exit(ComponentFailed.exit_code)


def entry(body: Callable[[], None]) -> None:
    """Run a component's main and exit with its code."""

    def main() -> int:
        try:
            body()
        except ModuleNotFoundError as error:
            raise UserError(f"the package {error.name} is not installed (in a clone: make setup)") from None
        return 0

    leave(one_line(main))
