"""`phototaxis train`: the same learning as over the bus, in one process."""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct
from phototaxis.arena import Arena
from phototaxis.checkpoint import save
from phototaxis.errors import UserError
from phototaxis.messages import World
from phototaxis_agent.agent import Agent
from phototaxis_agent.setup import Setup, parse_setup
from phototaxis_sim import arenas
from tqdm import tqdm

from phototaxis_lab.loop import Loop


class Options(Struct, kw_only=True):
    """Options of `phototaxis train`."""

    arena: str = "paper"
    """name of a shipped arena, or a TOML file"""
    seed: int = 0
    """decides everything: placements, noise, the learner and its exploration"""
    epochs: Annotated[int, Meta(ge=1)] = 3000
    """learning steps"""
    checkpoint: str = ""
    """file to keep what was learned in (.npz)"""
    json: bool = False
    """print the result as one JSON object, last on standard output"""


def train(setup: Setup, arena: Arena, seed: int, epochs: int, progress: bool = False) -> tuple[Agent, Loop, float]:
    """Learn for `epochs` steps; the agent, its loop, and the seconds it took."""
    world = World("lab", arena, seed, epochs)
    agent = setup.agent(world)
    loop = Loop(arena, agent, seed, epochs, run=world.run)
    began = time.perf_counter()
    with tqdm(total=epochs, unit=" epochs", disable=not progress) as bar:
        while not loop.simulation.finished:
            loop.step()
            bar.update(loop.simulation.state.epoch - bar.n)
        loop.finish()
    return agent, loop, time.perf_counter() - began


def main(argv: Sequence[str]) -> int:
    about = "Learn in one process, without a bus; the same seeds give the same hashes as `phototaxis up`."
    options, setup = parse_setup(Options, argv, "phototaxis train", about)
    path = Path(options.checkpoint) if options.checkpoint else None
    if path is not None and not path.parent.is_dir():
        raise UserError(f"--checkpoint {path}: there is no folder {path.parent}")
    arena = arenas.load(options.arena)
    agent, loop, seconds = train(setup, arena, options.seed, options.epochs, progress=sys.stderr.isatty())
    meta, arrays = agent.checkpoint()
    if path is not None:
        save(path, meta, arrays)
    simulation = loop.simulation
    result = {
        "arena": options.arena,
        "seed": options.seed,
        "learner": agent.name,
        "epochs": simulation.state.epoch,
        "episodes": simulation.episodes,
        "reached": simulation.reached,
        "ticks": simulation.state.tick,
        "ticks_per_second": round(simulation.state.tick / seconds, 1),
        "state_hash": simulation.state.hash,
        "learner_hash": meta.learner_hash,
        "checkpoint": str(path) if path else None,
    }
    if options.json:
        print(json.dumps(result))
    else:
        print(
            f"{result['epochs']} epochs, {result['episodes']} episodes, {result['reached']} of them reached the light; "
            f"{result['ticks_per_second']} ticks/s; state {result['state_hash']}, learner {result['learner_hash']}"
        )
    return 0
