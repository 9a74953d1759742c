"""Requests to the simulation, and its replies."""

from typing import Annotated, Literal

from msgspec import Meta

from phototaxis.wire.messages.base import Count, Message, Name, Seed
from phototaxis.wire.messages.run import Status


class Control(Message, kw_only=True):
    """A request to the simulation: about the run as a whole, or about one agent's place at the seat."""

    verb: Literal[
        "status", "pause", "resume", "step", "speed", "reset", "begin", "stop",
        "claim", "take over", "stand by", "release",
    ]  # fmt: skip
    """What the simulation does. status: nothing but reply. pause: it applies no more commands. resume: it goes on.
    step: it applies one command of a paused run. speed: it sets the pace to `speed`. reset: it ends the episode.
    begin: it starts a new run with `seed`, and the driver stays. stop: it ends the process. claim: it seats `agent` if
    the seat is free. take over: it seats `agent` at the first tick boundary from tick `at` on. stand by: it seats
    `agent` when nobody else drives. release: it takes `agent` from the seat and from the queue."""
    agent: Name = ""
    """Name of the agent whose seat is meant by claim, take over, stand by and release; else unused."""
    at: Count = 0
    """Number of the first tick at which take over may happen; else unused."""
    speed: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """Pace that speed sets, in simulated seconds per second, from 0 to 1,000; 0 is lockstep; else unused."""
    seed: Seed = 0
    """Seed of the run that begin starts; else unused."""


class ControlReply(Message, kw_only=True):
    """The simulation's reply to a request: whether it obeyed, and how the run is doing now."""

    ok: bool
    """Whether the simulation did what was asked."""
    reason: str
    """Why the request was refused, in one line; "" when it was obeyed."""
    status: Status
    """How the run is doing after the request."""
