"""The agent on the bus: its machine, its disk and its log in one loop."""

from collections.abc import Callable
from pathlib import Path

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.chunks import LogPublisher
from phototaxis.runtime.journal import Journal
from phototaxis.runtime.runner import Runner
from phototaxis.runtime.seat_client import Mode
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.runtime.store import Store
from phototaxis.wire.messages import World

from phototaxis_agent import kept
from phototaxis_agent.client import AgentClient
from phototaxis_agent.rows import AgentLogs
from phototaxis_agent.watchdog import watchdog


def serve(
    bus: Bus,
    make: Callable[[World], SeatedAgent],
    path: Path | None,
    resume: Path | None,
    required: bool,
    mode: Mode = "claim",
    at: int = 0,
) -> None:
    """Drive, or wait for the seat, until a "stop" event or until a successor drives; leave the seat and save.

    Parameters
    ----------
    make : makes the agent once the world is known.
    path : checkpoint to write; beside it, `.journal` holds the readings since. None: nothing is kept.
    resume : checkpoint to begin with, if it exists (`required`: it must). When it is of the run on the
        bus, the readings in the journal are gone through again, so that the agent is where it was killed.
    mode, at : how the seat is sought, and from which tick on it is taken over.

    Raises
    ------
    UserError
        for a checkpoint, a world or a learner that cannot be used.
    Unavailable
        when the last checkpoint cannot be written.
    """
    journal = None if path is None else Journal(path.with_suffix(".journal"))
    found = kept.read(resume, required, journal)
    client = AgentClient(bus.ident, make, found, path is not None, mode, at)
    with watchdog():
        Runner(bus, client, Store(journal, path), LogPublisher(bus, "log/agent", AgentLogs(bus.ident))).run()
