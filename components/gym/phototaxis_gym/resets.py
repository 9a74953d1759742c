"""What `reset` is given: seeds, poses and masks, checked as Gymnasium's own environments check theirs."""

import hashlib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from phototaxis.geometry.arena import Arena
from phototaxis_sim.physics import Physics, Pose

from phototaxis_gym.errors import WrongSeeds

MAX_SEED = 2**53
"""The largest seed of a run: JSON carries it exactly."""
LOW_SEED_BITS = 20


def run_seed(seed: int) -> int:
    """The seed of the run that stands for a seed of Gymnasium's, which may be any number.

    Up to `MAX_SEED` it is the number itself. Of a larger one the upper bits are hashed and the lower 20 kept, so that
    seeds which follow one another stay so.
    """
    if seed <= MAX_SEED:
        return int(seed)
    high, low = divmod(seed, 2**LOW_SEED_BITS)
    digest = hashlib.blake2b(high.to_bytes((high.bit_length() + 7) // 8), digest_size=4).digest()
    return int.from_bytes(digest) << LOW_SEED_BITS | low


def row_seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """One seed for each of `count` robots: S, S + 1, S + 2, … of a number S; None where a run goes on.

    Raises
    ------
    gymnasium.error.Error
        for a seed that is negative or no Python integer.
    WrongSeeds
        for a list of another length.
    """
    if seed is None:
        return [None] * count
    rows: Sequence[int | None] = [seed + row for row in range(count)] if isinstance(seed, int) else seed
    if len(rows) != count:
        raise WrongSeeds(f"{len(rows)} seeds: give one number, or one for each of the {count} robots")
    for one in rows:
        if one is not None and not (isinstance(one, int) and one >= 0):
            seeding.np_random(one)  # raises what Gymnasium has for it
    return list(rows)


def reset_mask(options: dict[str, Any] | None, count: int) -> np.ndarray:
    """(count,) bool: which robots are reset; all of them unless the options have a "reset_mask".

    Raises
    ------
    TypeError, ValueError
        as SyncVectorEnv does, for what is no array of so many bools with a True among them.
    """
    if not options or "reset_mask" not in options:
        return np.ones(count, bool)
    mask = options["reset_mask"]
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        what = f"an array of {mask.dtype}" if isinstance(mask, np.ndarray) else type(mask).__name__
        raise TypeError(f"options['reset_mask'] is {what}: a NumPy array of bools is needed")
    if mask.shape != (count,) or not mask.any():
        what = "names no robot" if mask.shape == (count,) else f"has the shape {mask.shape}"
        raise ValueError(
            f"options['reset_mask'] {what}: one bool for each of {count} robots, at least one of them True"
        )
    return mask.copy()


def given_poses(options: dict[str, Any] | None, arena: Arena, count: int = 1) -> dict[int, Pose]:
    """The poses (x, y in m, heading in rad) that the options give, by robot: one for all, or one for each.

    Raises
    ------
    ValueError
        when they are no such numbers, or when the robot has no room at one.
    """
    if not options or "pose" not in options:
        return {}
    given = options["pose"]
    try:
        numbers = np.asarray(given, float)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape not in {(3,), (count, 3)} or not np.isfinite(numbers).all():
        each = "" if count == 1 else f", or {count} such rows"
        raise ValueError(f"options['pose'] = {given!r}: x and y in m and the heading in rad are needed{each}")
    physics, (width, height), clear = Physics(arena), arena.size, arena.placement.clearance
    poses = {}
    for row, (x, y, heading) in enumerate(np.broadcast_to(numbers, (count, 3)).tolist()):
        poses[row] = pose = Pose(x, y, math.remainder(heading, math.tau))
        if not physics.free(pose):
            raise ValueError(
                f"options['pose'] = ({x:g}, {y:g}, {heading:g}): no room for the robot there; it must be inside the "
                f"{width:g} × {height:g} m and {clear:g} m away from every wall and obstacle"
            )
    return poses
