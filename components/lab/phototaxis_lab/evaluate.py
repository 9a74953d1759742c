"""`phototaxis evaluate`: measures the policy in a checkpoint, or in a file of Stable-Baselines3."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import CheckpointMetadata as Checkpoint
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.errors import UserError, warn
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.options import parse_groups
from phototaxis.wire.messages import Seed, World


class Options(Struct, kw_only=True):
    """Options of `phototaxis evaluate`."""

    checkpoint: str
    """checkpoint (.npz) whose policy is measured, or a policy (.zip) that Stable-Baselines3 has saved"""
    placements: Annotated[int, Meta(ge=1, le=1_000_000)] = 200
    """number of fresh random placements"""
    seed: Seed = 1
    """seed of the placements and of the policy's random choices; no seed repeats the placements of a training"""
    arena: str = ""
    """arena to measure in (default: that of the training; paper for a .zip, which does not name it)"""
    max_episode_steps: Annotated[int, Meta(ge=1)] = 300
    """steps after which a placement counts as failed"""
    trust: bool = False
    """load a .zip; such a file can run any code, so use this only if you trust its author"""
    normalize: str = ""
    """for a .zip that was trained through VecNormalize: the file (.pkl) that VecNormalize.save wrote, or none"""
    json: bool = False
    """print the result as one JSON object"""


def main(argv: Sequence[str]) -> int:
    about = "Freeze the policy of a checkpoint and measure it on fresh random placements."
    groups = {"": Options, "sensor models": FmuOptions}
    options, fmus = parse_groups(groups, argv, "phototaxis evaluate", about, positional=["checkpoint"])
    from phototaxis_agent.policies import is_policy, load_policy
    from phototaxis_agent.setup import from_checkpoint
    from phototaxis_agent.watchdog import watchdog
    from phototaxis_sensors.choice import choose_sensors
    from phototaxis_sim import arenas

    from phototaxis_lab.measure import SEED_OFFSET, evaluate, measure
    from phototaxis_lab.progress import Progress

    path = Path(options.checkpoint)
    if is_policy(path):
        arena = arenas.load_checked(options.arena or "paper")
        batch = load_policy(path, options.trust, options.normalize).batch(arena)
        with choose_sensors(fmus) as sensors, Progress(options.max_episode_steps, "steps") as progress:
            found = measure(
                arena, batch, options.placements, options.seed, options.max_episode_steps, sensors, progress.add
            )
        return tell(found, {"arena": options.arena or arena.name, "arena_digest": arena.digest}, options.json)
    if options.normalize:
        raise UserError(f"{path}: --normalize belongs to a policy that Stable-Baselines3 has saved (.zip)")
    meta, arrays = load(path)
    arena = where(path, meta, options.arena)
    setup = from_checkpoint(meta, str(path))
    world = World(run="evaluation", arena=arena, seed=options.seed + SEED_OFFSET, epochs=0)
    policy = setup.agent(world, learning=False).policy
    policy.take_over(meta, arrays, str(path))
    with watchdog(), choose_sensors(fmus) as sensors, Progress(options.max_episode_steps, "steps") as progress:
        found = evaluate(
            arena, policy, options.placements, options.seed, options.max_episode_steps, sensors, progress.add
        )
    place = {
        "arena": options.arena or arena.name,
        "arena_digest": arena.digest,
        "learned_in": meta.arena,
        "learned_in_digest": meta.arena_digest,
    }
    return tell(found, place, options.json)


def tell(found: Any, place: dict[str, str], as_json: bool) -> int:
    """Print the evaluation, and the arena that it was made in."""
    from phototaxis_lab.measure import describe

    told = msgspec.json.encode(msgspec.to_builtins(found) | place).decode()
    print(told if as_json else f"{describe(found)}; measured in the arena '{place['arena']}'")
    return 0


def where(path: Path, meta: Checkpoint, given: str) -> Arena:
    """Return the arena to measure in: the one that the user gives, else that of the training.

    Raises
    ------
    UserError
        when the user gives no arena, and that of the training is not a shipped one or has changed since.
    """
    from phototaxis_sim import arenas

    if not given and meta.arena not in arenas.shipped():
        raise UserError(f"{path}: learned in the arena '{meta.arena}', which is not shipped; give its file: --arena")
    arena = arenas.load_checked(given or meta.arena)
    if other := meta.elsewhere(arena):
        if not given:
            raise UserError(f"{path}: {other}; say which one to measure in: --arena with its name or file")
        warn(f"{path}: {other}")
    return arena
