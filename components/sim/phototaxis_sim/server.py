"""The simulation on the bus: its machine, its journal and its log in one loop."""

import secrets
from functools import partial

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.chunks import LogPublisher
from phototaxis.runtime.journal import Journal
from phototaxis.runtime.runner import Runner
from phototaxis.runtime.store import Store

from phototaxis_sim.batch_simulation import BatchSimulation
from phototaxis_sim.continued import open_journal
from phototaxis_sim.log import chunks
from phototaxis_sim.pace import Pace
from phototaxis_sim.simulation import Simulation
from phototaxis_sim.stepper import Stepper


def serve(
    bus: Bus, simulation: Simulation | BatchSimulation, pace: Pace, journal: Journal | None, driver_timeout: float
) -> None:
    """Run until a "stop" event or request.

    With a journal that holds the same run, it continues where that run was killed: the episode's start is restored and
    its commands are made again.

    Raises
    ------
    UserError
        when the journal is not one of a simulation.
    Unavailable
        when the journal cannot be begun, or was given up before the simulation died.
    """
    found = open_journal(journal, simulation) if journal is not None and isinstance(simulation, Simulation) else None
    stepper = Stepper(simulation, pace, partial(secrets.token_hex, 2), found, driver_timeout)
    Runner(bus, stepper, Store(journal), LogPublisher(bus, "log/sim", chunks(bus.ident))).run()
