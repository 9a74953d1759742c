"""`phototaxis status` and `phototaxis control`: talk to a running simulation from another terminal."""

import sys
from collections.abc import Sequence
from typing import Annotated, Literal

import msgspec
from msgspec import Meta
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.options import parse
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.messages import Control, ControlReply, Seed, Status

from phototaxis_launcher.progress import success

ANSWERS_WITHIN_S = 2.0
"""Seconds to wait for the simulation to appear on the bus, and again for its reply."""


class StatusOptions(BusOptions, kw_only=True):
    """Options of `phototaxis status`."""

    json: bool = False
    """print the status as one JSON object"""


class ControlOptions(BusOptions, kw_only=True):
    """Options of `phototaxis control`."""

    verb: Literal["pause", "resume", "step", "speed", "reset", "begin", "stop"]
    """what to do; step: advance a paused simulation by one tick; reset: end the episode; begin: start a new run"""
    speed: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """for the verb speed: simulated seconds per second; 0: lockstep"""
    seed: Seed = 0
    """for the verb begin: seed of the new run"""


def request(options: BusOptions, control: Control) -> ControlReply:
    """Send a control request to the simulation on the bus and return its reply.

    Raises
    ------
    Unavailable
        when there is no simulation, or it does not answer.
    """
    with open_session("observer", options) as session, Bus(session, options.name, "observer", "ask") as bus:
        if not bus.wait_for("sim", ANSWERS_WITHIN_S):
            raise Unavailable(f"no simulation in the world '{options.name}'; start one with: phototaxis up")
        reply = bus.control(control, timeout=ANSWERS_WITHIN_S)
    if reply is None:
        raise Unavailable(f"the simulation of '{options.name}' does not answer; is it stopped or overloaded?")
    return reply


def status(argv: Sequence[str]) -> int:
    about = "Show which components are alive, the current tick, the driver, the speed, and what the run waits for."
    options = parse(StatusOptions, argv, "phototaxis status", about)
    found = request(options, Control(verb="status")).status
    if options.json:
        print(msgspec.json.encode(found).decode())
    else:
        print("\n".join(describe(found)))
    return 0


def control(argv: Sequence[str]) -> int:
    about = "Pause, resume, single-step or stop the simulation, change its speed, end its episode, or start a new run."
    options = parse(ControlOptions, argv, "phototaxis control", about, positional=["verb"])
    reply = request(options, Control(verb=options.verb, speed=options.speed, seed=options.seed))
    if not reply.ok:
        raise UserError(reply.reason)
    print("\n".join(describe(reply.status)), file=sys.stderr)
    return 0


def describe(status: Status) -> list[str]:
    """Describe a status for a person, one line for each fact."""
    phase = status.phase
    if phase == "waiting":
        phase += f" for {status.waiting_for}, {status.waited:.1f} s"
    speed = f"{status.speed:g} × real time" if status.speed else "lockstep"
    rows = {
        "run": status.run,
        "phase": phase,
        "tick": f"{status.tick}  (epoch {status.epoch}{f' of {status.epochs}' if status.epochs else ''})",
        "episode": f"{status.episode}  ({success(status)})",
        "speed": f"{speed}, {status.rate:.0f} ticks/s",
        "driver": status.driver or "nobody",
        "alive": ", ".join(who.split("/")[1] for who in status.alive if not who.startswith("observer/")),
    }
    if status.late:
        rows["late"] = f"{status.late} ticks without a command in time" + f"; {status.too_slow}" * bool(status.too_slow)
    if status.warnings:
        rows["warnings"] = "; ".join(status.warnings)
    if status.refused:
        rows["refused"] = ", ".join(f"{reason} × {count}" for reason, count in status.refused.items())
    return [f"{name:8} {text}" for name, text in rows.items()]
