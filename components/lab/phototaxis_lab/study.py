"""Many seeds: each learns and is evaluated by itself, in parallel over the cores."""

import multiprocessing
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from msgspec import Struct
from phototaxis.arena import Arena
from phototaxis.messages import World
from phototaxis_agent.setup import Setup

from phototaxis_lab.loop import train
from phototaxis_lab.measure import SEED_OFFSET, evaluate

EVALUATION_SEED = 1
PLACEMENTS = 200


class Outcome(Struct):
    """One seed."""

    seed: int
    success_rate: float
    steps_mean: float | None
    path_ratio: float | None
    learner_hash: str


def one(setup: Setup, arena: Arena, epochs: int, seed: int) -> Outcome:
    """Learn with one seed, freeze, evaluate on 200 fresh placements."""
    meta, arrays = train(setup, arena, seed, epochs)[0].agent.checkpoint()
    frozen = setup.agent(World("evaluation", arena, seed + SEED_OFFSET, epochs), learning=False)
    frozen.take_over(meta, arrays, f"seed {seed}")
    found = evaluate(arena, frozen, PLACEMENTS, EVALUATION_SEED)
    return Outcome(seed, found.success_rate, found.steps_mean, found.path_ratio, meta.learner_hash)


def study(setup: Setup, arena: Arena, epochs: int, seeds: Sequence[int]) -> Iterator[Outcome]:
    """The outcomes of all seeds, in their order, as they come."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=min(os.cpu_count() or 1, len(seeds)), mp_context=context) as pool:
        yield from pool.map(partial(one, setup, arena, epochs), seeds)


def summary(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Median and worst success rate, and the share of seeds at 80% or better."""
    rates = np.array([outcome.success_rate for outcome in outcomes])
    return {
        "median": float(np.median(rates)),
        "min": float(rates.min()),
        "at_least_80_percent": float((rates >= 0.8).mean()),
    }
