"""`phototaxis experiment`: computes a grid of agents and seeds in parallel, and can be interrupted and continued."""

import json
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, field
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import parse

from phototaxis_lab.running import SEEDS, Running, seed_range

LIST = Annotated[str, Meta(pattern=r"^[^, ]+(,[^, ]+)*$", description="a list with commas and without spaces")]


class Options(Running, kw_only=True):
    """Options of `phototaxis experiment`; lists are separated by commas, and all combinations are computed."""

    learners: LIST = "qtable"
    """names of learners"""
    percepts: LIST = "simple"
    """percepts: simple, rich, continuous"""
    rewards: LIST = "preset"
    """reward schemes: difference, static, potential; own: the paper's for the percept; preset: the learner's choice"""
    epochs: LIST = "3000"
    """numbers of learning steps"""
    seeds: SEEDS = "0:20"
    """A:B: the seeds from A to B − 1"""
    arena: str = "paper"
    """name of a shipped arena, or a TOML file"""
    set: list[str] = field(default_factory=list)
    """NAME=VALUE: an option for all agents (may be repeated)"""
    out: str = "runs/experiment"
    """folder of the results; the same command continues an interrupted experiment there"""
    json: bool = False
    """print the summary as one JSON object"""


def main(argv: Sequence[str]) -> int:
    about = "Let every combination of learners, percepts, rewards and epochs learn with every seed, and measure each."
    options = parse(Options, argv, "phototaxis experiment", about)
    from phototaxis_lab.grid import compute, describe, summarise

    results = compute(cells(options), Path(options.out), options)
    summaries = summarise(results)
    text = json.dumps({"out": options.out, "systems": summaries}) if options.json else describe(summaries)
    print(text, flush=True)
    results.settle()
    return 0


def cells(options: Options) -> list[Any]:
    """Return the cells of all combinations; UserError when a system cannot be built, before anything is computed."""
    from phototaxis_lab.cell import Cell, System

    given = tuple(_pair(text) for text in options.set)
    lists = options.learners.split(","), options.percepts.split(","), options.rewards.split(",")
    systems = [System(learner, percept, reward, options.arena, given) for learner, percept, reward in product(*lists)]
    for system in systems:
        system.check()
    epochs = [_steps(text) for text in options.epochs.split(",")]
    return [Cell(*what) for what in product(systems, epochs, seed_range(options.seeds))]


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise UserError(f"--set {text}: expected NAME=VALUE, as in gamma=0.9")
    if name in ("learner", "percept", "reward"):
        raise UserError(f"--set {text}: give it as --{name}s {value}")
    return name.replace("-", "_"), value


def _steps(text: str) -> int:
    if not text.isdecimal() or not int(text):
        raise UserError(f"--epochs {text}: expected whole numbers above 0, separated by commas, as in 300,3000")
    return int(text)
