"""How good is a frozen policy? Measured on fresh random placements."""

import math

import msgspec
import numpy as np
from msgspec import Struct
from phototaxis.arena import Arena
from phototaxis.messages import Episode
from phototaxis.task import REACHED
from phototaxis_agent.agent import Agent

from phototaxis_lab.loop import Loop

SEED_OFFSET = 1_000_000_007
"""Added to an evaluation's seed, so that its placements and noise are none of the training's."""

CAP = 300
"""Steps after which a placement counts as failed."""


class Evaluation(Struct):
    """What an evaluation found."""

    placements: int
    success_rate: float
    """Share of placements from which the light was reached within the step cap."""
    steps_mean: float | None
    """Mean steps of the successful placements; None without any."""
    path_ratio: float | None
    """Steps over straight-line steps, mean of the successful placements."""
    cap: int
    seed: int


def straight_steps(arena: Arena, start: Episode) -> float:
    """Steps at full speed along the straight line to where the first light reads above 0.95.

    A lower bound that ignores turning and obstacles; at least 1.
    """
    motion, robot, law = arena.motion, arena.robot, arena.sensing
    ahead = max(x for x, _ in robot.light_sensors)
    nearest = math.inf
    for light in arena.lights:
        if law.light_law == "linear":
            radius = law.light_range * (1 - REACHED / light.brightness)
        else:
            radius = math.sqrt(light.brightness / REACHED)
        nearest = min(nearest, math.dist((start.x, start.y), light.position) - radius - ahead)
    return max(nearest / (robot.speed * motion.control_period), 1.0)


def evaluate(arena: Arena, agent: Agent, placements: int, seed: int, cap: int = CAP) -> Evaluation:
    """Place the robot `placements` times at random and let the frozen agent drive."""
    if agent.learning:
        raise ValueError("an agent that is evaluated must not learn")
    agent.task = msgspec.structs.replace(agent.task, cap=cap)
    loop = Loop(arena, agent, seed + SEED_OFFSET)
    steps, ratios = [], []
    for _ in range(placements):
        while (ended := loop.step()) is None:
            pass
        if ended.end == "reached":
            steps.append(ended.steps)
            ratios.append(ended.steps / straight_steps(arena, ended))
    return Evaluation(
        placements=placements,
        success_rate=len(steps) / placements,
        steps_mean=float(np.mean(steps)) if steps else None,
        path_ratio=float(np.mean(ratios)) if ratios else None,
        cap=cap,
        seed=seed,
    )


def describe(found: Evaluation) -> str:
    """An evaluation in words."""
    words = (
        f"{found.success_rate:.1%} of {found.placements} fresh placements reached the light within {found.cap} steps"
    )
    if found.steps_mean is not None:
        words += f"; {found.steps_mean:.1f} steps on average, {found.path_ratio:.1f} × the straight line"
    return words
