"""A whole system on the simulated network: the real simulation, sensors and agents, each from what is on its disk."""

from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from random import Random

from phototaxis.geometry.arena import Arena
from phototaxis.runtime.chunks import LogPublisher
from phototaxis.runtime.seat_client import Mode
from phototaxis.runtime.store import Store
from phototaxis.wire.messages import World
from phototaxis_agent import kept
from phototaxis_agent.agent import Agent
from phototaxis_agent.client import AgentClient
from phototaxis_agent.rows import AgentLogs
from phototaxis_sensors.choice import make_suite
from phototaxis_sensors.sensing import Sensing
from phototaxis_sensors.server import chunk
from phototaxis_sim.continued import open_journal
from phototaxis_sim.log import chunks
from phototaxis_sim.pace import Pace
from phototaxis_sim.phases import Phase
from phototaxis_sim.simulation import Simulation
from phototaxis_sim.stepper import Stepper
from phototaxis_sim.steps import Steps

from simulated.disk import Disk
from simulated.network import Network, Weather
from simulated.operator import Operator
from simulated.process import Process
from simulated.sensing import RememberedChoice
from simulated.timeline import Timeline
from simulated.witness import Witness, watch_learning

BACK_AFTER_S = 0.05
"""Seconds after which a process that died is started again."""


class System:
    """Simulation, sensors and agents of one run.

    Parameters
    ----------
    folder : where the simulation and the agents keep their checkpoints and journals.
    seed : of all faults; the world has a seed of its own.
    make : makes an agent that has learned nothing.

    Attributes
    ----------
    disks : the journal of each process that keeps one, by the process's name.
    """

    def __init__(
        self, folder: Path, seed: int, arena: Arena, make: Callable[[World], Agent], world_seed: int, epochs: int
    ):
        self.timeline, self.rng, self.witness = Timeline(), Random(seed), Witness()
        self.network = Network(self.timeline, self.rng, Weather())
        self.disks: dict[str, Disk] = {}
        self._folder, self._make, self._starts = folder, make, 0
        self._stepper: Stepper | None = None
        self._suffixes = count()
        self._fresh = lambda: Simulation(arena, world_seed, "run", epochs)
        self._pace = lambda: Pace(arena.motion.control_period)

    def _process(self, role: str, ident: str = "") -> Process:
        self._starts += 1
        return Process(self.network, role, ident or f"{role}-{self._starts}", self.witness.carried)

    def _disk(self, process: Process, path: Path) -> Disk:
        self.disks[process.ident] = disk = Disk(path)
        return disk

    def simulation(self) -> Process:
        """Start the simulation, or start it again from its journal."""
        process = self._process("sim")
        journal = self._disk(process, self._folder / "sim.journal")
        fresh = self._fresh()
        self._stepper = Stepper(
            fresh, self._pace(), lambda: f"{next(self._suffixes):04x}", open_journal(journal, fresh)
        )
        log = LogPublisher(process, "log/sim", chunks(process.ident))
        process.start(self._stepper, journal, Store(journal), log)
        return process

    @property
    def steps(self) -> Steps | None:
        """The simulation's run and seat; None before it starts."""
        return None if self._stepper is None else self._stepper.steps

    @property
    def finished(self) -> bool:
        """Whether the last tick has its answer."""
        return self.steps is not None and self.steps.state is Phase.FINISHED

    @property
    def driver(self) -> str:
        """Who holds the seat."""
        return "" if self.steps is None else self.steps.seat.driver

    @property
    def hash(self) -> str:
        """The state's hash at the present tick."""
        return "" if self.steps is None else self.steps.simulation.state.hash

    @property
    def tick(self) -> int:
        """The present tick; −1 before the simulation starts."""
        return -1 if self.steps is None else self.steps.tick

    def sensors(self) -> Process:
        """Start the sensors."""
        process = self._process("sensors")
        log = LogPublisher(process, "log/sensors", partial(chunk, process.ident))
        process.start(Sensing(partial(make_suite, RememberedChoice())), log=log)
        return process

    def checkpoint(self, name: str) -> Path:
        """Where the agent called so keeps itself."""
        return self._folder / f"{name}.npz"

    def agent(self, name: str, mode: Mode = "claim", at: int = 0, restarted: bool = False) -> Process:
        """Start an agent, or start it again from what it left on disk."""
        process, path = self._process("agent", name), self.checkpoint(name)
        journal = self._disk(process, path.with_suffix(".journal"))
        found = kept.read(path if restarted else None, False, journal)

        def make(world):
            return watch_learning(self._make(world), self.witness)

        client = AgentClient(name, make, found, True, mode, at)
        if restarted:
            self.witness.restarted(name, found)
        log = LogPublisher(process, "log/agent", AgentLogs(process.ident))
        process.start(client, journal, Store(journal, path), log)
        return process

    def operator(self) -> Process:
        """Start somebody who puts requests to the simulation."""
        process = self._process("observer")
        process.start(Operator())
        return process

    def finish(self, limit: float) -> bool:
        """Whether the run ends within `limit` seconds of virtual time, and what is still to come has come."""
        done = self.timeline.run(lambda: self.finished, limit)
        self.network.weather = Weather()
        self.timeline.run(lambda: False, 1.0)
        return done
