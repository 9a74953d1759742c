"""`phototaxis train`: lets an agent learn in one process, exactly as over the bus."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta
from phototaxis.runtime.checkpoint import save
from phototaxis.runtime.disk import check_writable
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.wire.messages import Seed

from phototaxis_lab.running import SEEDS, Running, seed_range


class Options(Running, kw_only=True):
    """Options of `phototaxis train`."""

    arena: str = "paper"
    """name of a shipped arena, or a TOML file"""
    seed: Seed = 0
    """seed of all randomness: placements, noise, the learner and its exploration"""
    seeds: SEEDS = ""
    """A:B: learn with each seed from A to B − 1 and evaluate each on 200 fresh placements"""
    epochs: Annotated[int, Meta(ge=1)] = 3000
    """learning steps"""
    checkpoint: str = ""
    """file (.npz) in which to save what was learned"""
    json: bool = False
    """print the result as one JSON object, as the last line of standard output"""


def main(argv: Sequence[str]) -> int:
    from phototaxis_agent.setup import parse_setup

    about = "Learn in one process, without a bus; the same seeds give the same hashes as `phototaxis up`."
    options, setup, fmus = parse_setup(Options, argv, "phototaxis train", about, {"sensor models": FmuOptions})
    if options.checkpoint and options.seeds:
        raise UserError("--checkpoint saves one learner, but --seeds trains many; give only one of the two")
    if options.checkpoint:
        check_writable(Path(options.checkpoint), "--checkpoint")
    if options.seeds and fmus != FmuOptions():
        raise UserError("--seeds trains many learners, with the built-in sensors only; leave the FMU out")
    from phototaxis_sensors.choice import choose_sensors
    from phototaxis_sim import arenas

    arena, fault = arenas.load_checked(options.arena), None
    if options.seeds:
        found = train_seeds(options, setup)
    else:
        with choose_sensors(fmus) as make:
            found, fault = train_seed(options, setup, arena, make)
    if options.json:
        print(json.dumps(found), flush=True)
    if fault:
        raise fault
    return 0


def train_seed(options: Options, setup: Any, arena: Any, make: Any) -> tuple[dict[str, Any], UserError | None]:
    """Learn with one seed; return the result, and the error if the checkpoint could not be written."""
    from phototaxis_agent.watchdog import watchdog

    from phototaxis_lab.loop import train

    with watchdog():
        loop, seconds = train(setup, arena, options.seed, options.epochs, make)
        meta, arrays = loop.agent.checkpoint()
        kept, fault = options.checkpoint or None, None
        try:
            if kept:
                loop.agent.prove(arrays)
                save(Path(kept), meta, arrays)
        except UserError as error:
            kept, fault = None, error
    simulation = loop.simulation
    found = {
        "arena": options.arena,
        "seed": options.seed,
        "learner": meta.learner,
        "epochs": simulation.state.epoch,
        "episodes": simulation.episodes,
        "reached": simulation.reached,
        "ticks": simulation.state.tick,
        "ticks_per_second": round(simulation.state.tick / seconds, 1),
        "state_hash": simulation.state.hash,
        "learner_hash": meta.learner_hash,
        "checkpoint": kept,
    }
    if not options.json:
        print(
            f"{found['epochs']} epochs, {found['episodes']} episodes, {found['reached']} of them reached the light; "
            f"{found['ticks_per_second']} ticks/s; state {found['state_hash']}, learner {found['learner_hash']}",
            flush=True,
        )
    return found, fault


def train_seeds(options: Options, setup: Any) -> dict[str, Any]:
    """Learn with many seeds; return the success of each, and a summary."""
    from phototaxis_lab.cell import Cell, System
    from phototaxis_lab.grid import summary, with_progress
    from phototaxis_lab.parallel import cluster

    system = System.of(setup, options.arena)
    cells = [Cell(system, options.epochs, seed) for seed in seed_range(options.seeds)]
    with cluster(options.backend, options.scheduler):
        outcomes = [outcome for _, outcome in sorted(with_progress(cells, options))]
    fields = "seed", "success_rate", "within_100", "steps_mean", "path_ratio", "learner_hash"
    seeds = [{field: getattr(outcome, field) for field in fields} for outcome in outcomes]
    found = {"learner": system.learner, "epochs": options.epochs, "seeds": seeds, **summary(outcomes)}
    if not options.json:
        for one in seeds:
            ratio = "" if one["path_ratio"] is None else f"; path ratio {one['path_ratio']:.1f}"
            print(
                f"seed {one['seed']:4}  {one['success_rate']:6.1%} of 200 fresh placements, "
                f"{one['within_100']:6.1%} within 100 steps{ratio}"
            )
        low, high = found["interval"]
        print(f"median {found['median']:.1%} (95% interval {low:.1%} to {high:.1%}), worst {found['min']:.1%}")
    return found
