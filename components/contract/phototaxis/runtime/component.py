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
"""Seconds that a tethered component has to shut down cleanly after its parent process is gone."""


class ComponentOptions(BusOptions, kw_only=True):
    """Options that every component has."""

    tethered: bool = False
    """end when standard input closes, so that no process outlives the one that started it"""
    label: Annotated[str, Meta(max_length=40, pattern=r"^[A-Za-z0-9_.-]*$", description=WORD, examples=["robot-1"])] = (
        ""
    )
    """a word to include in the generated name on the bus, by which `phototaxis health` finds the component"""
    ident: Annotated[str, Meta(max_length=24, pattern=r"^[A-Za-z0-9_.-]*$", description=WORD, examples=["robot-1"])] = (
        ""
    )
    """the whole name on the bus: unique and never reused (default: generated)"""
    restarted: bool = False
    """continue from the files of a process that died, if there are any"""


def run(
    role: str, options: ComponentOptions, serve: Callable[[Bus], None], kind: str = "", worlds: Sequence[str] = ()
) -> None:
    """Open the bus as `role`, call `serve(bus)`, and close everything at the end, also after an error.

    SIGTERM and SIGINT put a "stop" event into the inbox; `serve` returns on it. With several `worlds` in
    place of `options.name`, each is served in a thread of its own; the first error ends all of them.

    Raises
    ------
    KeyboardInterrupt
        after SIGINT, once everything is closed, so that the exit code is 130.
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
        while wait(served, timeout=0.2).not_done:  # wakes up so that Python runs signal handlers
            if any(one.done() and one.exception() for one in served):
                stop()
    for one in served:
        one.result()


def _stop(buses: Sequence[Bus]) -> None:
    for bus in buses:
        bus.stop()


def unique_name(kind: str, label: str = "") -> str:
    """Generate a name that is unique on the bus, even among processes that start at the same moment."""
    return "-".join(filter(None, (kind[:15], label, secrets.token_hex(4))))


def _hold_tether(stop: Callable[[], None]) -> None:
    """Stop when standard input closes, and kill the process after `ORDERLY_END_S` if a plug-in does not return."""
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
