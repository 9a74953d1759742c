"""Measures how well a frozen policy finds the light from fresh random placements."""

import math
from collections.abc import Callable

import numpy as np
from msgspec import Struct
from phototaxis.geometry.arena import Arena
from phototaxis.task import GOAL_LIGHT, BatchObservation, Episode
from phototaxis.wire.messages import World
from phototaxis_agent.batch_agent import BatchAgent
from phototaxis_agent.policy import Policy
from phototaxis_sensors.choice import BuiltInFactory, SensorFactory
from phototaxis_sim.batch_physics import BatchPhysics
from phototaxis_sim.physics import Physics, Pose

SEED_OFFSET = 1_000_000_007
"""Added to the seed of an evaluation, so that its placements and noise differ from those of a training."""

MAX_EPISODE_STEPS = 300
"""Steps after which a placement counts as failed."""


class Evaluation(Struct):
    """The result of an evaluation."""

    placements: int
    success_rate: float
    """Share of placements from which the robot reached the light within `max_episode_steps`."""
    steps_mean: float | None
    """Mean number of steps of the successful placements; None if there are none."""
    path_ratio: float | None
    """Sum of the steps of all successful placements, divided by the sum of their `direct_steps`; None if there are
    none."""
    within_100: float
    """Share of placements from which the robot reached the light within 100 steps."""
    max_episode_steps: int
    seed: int


def direct_steps(arena: Arena, start: Pose) -> float:
    """Return the steps to turn on the spot towards a light, and to drive straight until it reads above 0.95.

    Obstacles are ignored; of several lights the one with the fewest steps counts; the result is at least 1.
    """
    motion, robot, law = arena.motion, arena.robot, arena.sensing
    ahead = max(x for x, _ in robot.light_sensors)
    fewest = math.inf
    for light in arena.lights:
        if law.light_law == "linear":
            radius = law.light_range * (1 - GOAL_LIGHT / light.brightness)
        else:
            radius = math.sqrt(light.brightness / GOAL_LIGHT)
        dx, dy = light.position[0] - start.x, light.position[1] - start.y
        turn = abs(math.remainder(math.atan2(dy, dx) - start.heading, math.tau))
        straight = max(math.hypot(dx, dy) - radius - ahead, 0.0)
        fewest = min(fewest, (turn / robot.turn + straight / robot.speed) / motion.control_period)
    return max(fewest, 1.0)


BUILT_IN = BuiltInFactory()


def evaluate(
    arena: Arena,
    policy: Policy,
    placements: int,
    seed: int,
    max_episode_steps: int = MAX_EPISODE_STEPS,
    sensors: SensorFactory = BUILT_IN,
    stepped: Callable[[], object] = lambda: None,
) -> Evaluation:
    """Place `placements` robots at random, and let the frozen policy drive each of them for one episode.

    `stepped` is called after each step of all robots.
    """
    if policy.learning:
        raise ValueError("a policy that is evaluated must not learn")
    batch = BatchAgent(policy, arena.sensing.near, placements, seed)
    return measure(arena, batch, placements, seed, max_episode_steps, sensors, stepped)


Drive = Callable[[Episode], np.ndarray]
"""Maps the episodes of N robots, after their newest observation, to motor commands, shape (N, 2)."""


def measure(
    arena: Arena,
    drive: Drive,
    placements: int,
    seed: int,
    max_episode_steps: int = MAX_EPISODE_STEPS,
    sensors: SensorFactory = BUILT_IN,
    stepped: Callable[[], object] = lambda: None,
) -> Evaluation:
    """Place `placements` robots at random as `evaluate` does, and let `drive` choose their motor commands."""
    seed += SEED_OFFSET
    physics = Physics(arena)
    starts = [physics.random_pose(np.random.default_rng((seed, number))) for number in range(placements)]
    batch = BatchPhysics(arena, starts)
    suite = sensors.batch(World(run="evaluation", arena=arena, seed=seed, epochs=0), placements)

    def observe(tick: int) -> BatchObservation:
        return BatchObservation(*suite(tick, batch.poses), batch.front, batch.rear)

    episode = Episode(max_episode_steps, placements)
    episode.begin(observe(0))
    reached, steps, tick = episode.terminated, episode.steps, 0
    while not (reached | episode.truncated).all():
        batch.drive(*np.where(reached, 0.0, drive(episode).T))
        stepped()
        tick += 1
        episode.step(observe(tick))
        steps = np.where(reached, steps, episode.steps)
        reached = reached | episode.terminated
    bounds = np.array([direct_steps(arena, start) for start in starts])
    return Evaluation(
        placements=placements,
        success_rate=float(reached.mean()),
        steps_mean=float(steps[reached].mean()) if reached.any() else None,
        path_ratio=float(steps[reached].sum() / bounds[reached].sum()) if reached.any() else None,
        within_100=float((reached & (steps <= 100)).mean()),
        max_episode_steps=max_episode_steps,
        seed=seed - SEED_OFFSET,
    )


def describe(found: Evaluation) -> str:
    """Describe an evaluation in words."""
    words = (
        f"{found.success_rate:.1%} of {found.placements} fresh placements reached the light "
        f"within {found.max_episode_steps} steps"
    )
    if found.steps_mean is not None:
        words += f"; {found.steps_mean:.1f} steps on average, {found.path_ratio:.1f} × the direct way"
    return words
