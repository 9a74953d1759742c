"""`phototaxis sim`: the simulation as a process."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.component import ComponentOptions, entry, run
from phototaxis.runtime.disk import check_writable
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.journal import Journal
from phototaxis.runtime.options import parse
from phototaxis.runtime.phrases import WORD
from phototaxis.wire.messages import MAX_ROBOTS, Count, Seed, run_name


class Options(ComponentOptions, kw_only=True):
    """Options of the simulation."""

    arena: str = "paper"
    """name of a shipped arena, or a TOML file"""
    seed: Seed = 0
    """seed of the placements and the sensor noise"""
    epochs: Count = 0
    """learning steps after which the run is finished; 0: run until stopped"""
    speed: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """simulated seconds per second; 0: lockstep, as fast as the answers come"""
    run: Annotated[str, Meta(max_length=64, pattern=r"^[A-Za-z0-9_.-]*$", description=WORD, examples=["run-1"])] = ""
    """name of the run (default: date, time and a few random letters)"""
    driver_timeout: Annotated[float, Meta(gt=0)] = 5.0
    """seconds after which a silent driver loses the seat, if another agent waits for it"""
    robots: Annotated[int, Meta(ge=1, le=MAX_ROBOTS)] = 1
    """number of robots, each alone in its arena; robot i starts as in a run with the seed `seed` + i"""
    journal: str = ""
    """file from which a killed simulation continues its run (with one robot only)"""


def main(argv: Sequence[str] | None = None) -> None:
    options = parse(Options, argv, "phototaxis sim", "Run the world: physics, time and the seat.")
    from phototaxis_sim import arenas
    from phototaxis_sim.batch_simulation import BatchSimulation
    from phototaxis_sim.pace import Pace
    from phototaxis_sim.server import serve as serve_simulation
    from phototaxis_sim.simulation import Simulation

    arena = arenas.load_checked(options.arena)
    setting = arena, options.seed, options.run or run_name(), options.epochs
    simulation = BatchSimulation(*setting, options.robots) if options.robots > 1 else Simulation(*setting)
    if options.robots > 1 and options.restarted:
        raise UserError("a simulation of many robots that died is not continued; start the run again")
    journal = Journal(Path(options.journal)) if options.journal and options.robots == 1 else None
    if journal is not None:
        check_writable(journal.path, "--journal")

    def serve(bus: Bus) -> None:
        pace = Pace(arena.motion.control_period, options.speed)
        serve_simulation(bus, simulation, pace, journal, options.driver_timeout)

    run("sim", options, serve)


if __name__ == "__main__":
    entry(main)
