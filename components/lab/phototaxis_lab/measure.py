"""How good is a frozen policy? Measured on fresh random placements."""

import math
from collections.abc import Callable

import numpy as np
from msgspec import Struct
from phototaxis.arena import Arena
from phototaxis.messages import World
from phototaxis.task import REACHED, CrowdReadings, lit
from phototaxis_agent.agent import Agent
from phototaxis_agent.crowd import CrowdAgent
from phototaxis_sensors.choice import BuiltInChoice, Choice
from phototaxis_sim.crowd import Crowd
from phototaxis_sim.physics import Physics, Pose

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
    """All steps of the successful placements over the steps of their direct ways (`direct_steps`)."""
    within_100: float
    """Share of placements from which the light was reached within 100 steps."""
    cap: int
    seed: int


def direct_steps(arena: Arena, start: Pose) -> float:
    """Steps to turn on the spot towards a light and drive straight to where it reads above 0.95.

    The light that takes the fewest; obstacles are ignored; at least 1.
    """
    motion, robot, law = arena.motion, arena.robot, arena.sensing
    ahead = max(x for x, _ in robot.light_sensors)
    fewest = math.inf
    for light in arena.lights:
        if law.light_law == "linear":
            radius = law.light_range * (1 - REACHED / light.brightness)
        else:
            radius = math.sqrt(light.brightness / REACHED)
        dx, dy = light.position[0] - start.x, light.position[1] - start.y
        turn = abs(math.remainder(math.atan2(dy, dx) - start.heading, math.tau))
        straight = max(math.hypot(dx, dy) - radius - ahead, 0.0)
        fewest = min(fewest, (turn / robot.turn + straight / robot.speed) / motion.control_period)
    return max(fewest, 1.0)


BUILT_IN = BuiltInChoice()


def evaluate(
    arena: Arena,
    agent: Agent,
    placements: int,
    seed: int,
    cap: int = CAP,
    sensors: Choice = BUILT_IN,
    stepped: Callable[[], object] = lambda: None,
) -> Evaluation:
    """Place `placements` robots at random, one at a place, and let the frozen agent drive each for `cap` steps.

    `stepped` is called when all have made one more of them.
    """
    if agent.learning:
        raise ValueError("an agent that is evaluated must not learn")
    policy = CrowdAgent(agent, arena.sensing.near, placements, seed)
    return measure(arena, policy, placements, seed, cap, sensors, stepped)


Policy = Callable[[CrowdReadings], np.ndarray]
"""From what N robots sense to their motor commands, (N, 2)."""


def measure(
    arena: Arena,
    policy: Policy,
    placements: int,
    seed: int,
    cap: int = CAP,
    sensors: Choice = BUILT_IN,
    stepped: Callable[[], object] = lambda: None,
) -> Evaluation:
    """The same for any policy."""
    seed += SEED_OFFSET
    physics = Physics(arena)
    starts = [physics.random_pose(np.random.default_rng((seed, number))) for number in range(placements)]
    crowd, suite = (
        Crowd(arena, starts),
        sensors.crowd(World(run="evaluation", arena=arena, seed=seed, epochs=0), placements),
    )
    steps = np.full(placements, -1)
    for step in range(cap + 1):
        readings = CrowdReadings(*suite(step, crowd.poses), crowd.front, crowd.rear)
        steps[(steps < 0) & lit(readings)] = step
        if step == cap or (steps >= 0).all():
            break
        left, right = np.where(steps < 0, policy(readings).T, 0.0)
        crowd.drive(left, right)
        stepped()
    reached = steps >= 0
    bounds = np.array([direct_steps(arena, start) for start in starts])
    return Evaluation(
        placements=placements,
        success_rate=float(reached.mean()),
        steps_mean=float(steps[reached].mean()) if reached.any() else None,
        path_ratio=float(steps[reached].sum() / bounds[reached].sum()) if reached.any() else None,
        within_100=float((reached & (steps <= 100)).mean()),
        cap=cap,
        seed=seed - SEED_OFFSET,
    )


def describe(found: Evaluation) -> str:
    """An evaluation in words."""
    words = (
        f"{found.success_rate:.1%} of {found.placements} fresh placements reached the light within {found.cap} steps"
    )
    if found.steps_mean is not None:
        words += f"; {found.steps_mean:.1f} steps on average, {found.path_ratio:.1f} × the direct way"
    return words
