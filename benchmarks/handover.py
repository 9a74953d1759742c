"""Measures how long the robot waits when its driver is swapped, killed or frozen. Part of `make bench`."""

import os
import secrets
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from typing import Any

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.codec import Decoder
from phototaxis.wire.messages import State, Status

DEADLINE = 30.0
"""Seconds to wait for each change of the system's status."""


def measure(rounds: int) -> dict[str, tuple[float, float]]:
    """Return, for each way, the wait from the old driver's last tick to the new one's first: ms, and in usual ticks."""
    ways = {"swapped (inherits over the bus)": None, "killed": signal.SIGKILL, "frozen (SIGSTOP)": signal.SIGSTOP}
    found: dict[str, list[tuple[float, float]]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, number in ways.items():
            found[way].append(_pause(number))
    return {way: (_median(pairs, 0), _median(pairs, 1)) for way, pairs in found.items()}


def _median(pairs: list[tuple[float, float]], place: int) -> float:
    return statistics.median(pair[place] for pair in pairs)


def _pause(number: signal.Signals | None) -> tuple[float, float]:
    """Return the wait in ms and in usual ticks when a signal stops the driver and a standby drives on.

    With None, there is no signal, but a swap at tick 2,000.
    """
    world, ticks = f"bench-{secrets.token_hex(3)}", dict[int, tuple[float, str]]()
    decode = Decoder(State, 4096)

    def note(sample: Any) -> None:
        state = decode(sample.payload.to_bytes())
        ticks.setdefault(state.tick, (time.perf_counter(), state.author))

    with (
        _process("sim", world),
        _process("sensors", world),
        open_session("observer", BusOptions(name=world)) as session,
        Bus(session, world, "observer", "bench") as bus,
        ExitStack() as agents,
    ):
        session.declare_subscriber(f"{world}/state", note)
        if number is None:
            agents.enter_context(_process("agent", world, "--ident", "new", "--take-over", "--at", "2000"))
            _until(bus, lambda status: "new" in status.next)
        old = agents.enter_context(_process("agent", world, "--ident", "old"))
        _until(bus, lambda status: status.driver == "old")
        if number is not None:
            agents.enter_context(_process("agent", world, "--ident", "new", "--standby"))
            _until(bus, lambda status: "new" in status.next)
            _pass(bus, 500)
            os.kill(old.pid, number)
        _until(bus, lambda status: status.driver == "new")
        _pass(bus, 200)
    moments = [(*ticks[tick], tick) for tick in sorted(ticks)]
    steps = [later[0] - earlier[0] for earlier, later in pairwise(moments)]
    first = next(index for index, (_, author, _) in enumerate(moments) if author == "new")
    pause = max(steps[first - 3 : first])  # of 3 steps, since a tick that begins an episode has no author
    return 1000 * pause, pause / statistics.median(steps)


def _pass(bus: Bus, ticks: int) -> None:
    """Wait until some ticks have passed."""
    first: list[int] = []
    _until(bus, lambda status: first.append(status.tick) or status.tick > first[0] + ticks)


def _until(bus: Bus, wanted: Callable[[Status], bool]) -> None:
    deadline = time.monotonic() + DEADLINE
    while time.monotonic() < deadline:
        event = bus.receive(timeout=0.1)
        if event is not None and event.topic == "status" and wanted(event.message):
            return
    raise SystemExit(f"the system did not reach the expected status within {DEADLINE:g} s")


@contextmanager
def _process(role: str, world: str, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [sys.executable, "-m", f"phototaxis_{role}", "--name", world, *words], stderr=subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def lines(rounds: int) -> list[str]:
    """Measure, and return the result as lines for a person."""
    rows = [f"  {way:40} {pause:9.1f} {ticks:12.0f}" for way, (pause, ticks) in measure(rounds).items()]
    return [f"  {'':40} {'pause, ms':>9} {'usual ticks':>12}", *rows]


if __name__ == "__main__":
    print("\n".join(lines(5)))
