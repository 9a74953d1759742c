"""Checks the arguments of `reset` as Gymnasium's own environments do: seeds, poses and masks."""

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
"""The largest seed of a run; JSON readers with 64-bit floats still represent it exactly."""
LOW_SEED_BITS = 20
"""Low bits of a larger seed that `run_seed` keeps."""


def run_seed(seed: int) -> int:
    """Convert a seed of Gymnasium's, which may be any natural number, to the seed of a run.

    A seed up to `MAX_SEED` stays as it is. For a larger one the upper bits are hashed and the lower 20 bits kept, so
    that consecutive seeds stay consecutive.
    """
    if seed <= MAX_SEED:
        return int(seed)
    high, low = divmod(seed, 2**LOW_SEED_BITS)
    digest = hashlib.blake2b(high.to_bytes((high.bit_length() + 7) // 8), digest_size=4).digest()
    return int.from_bytes(digest) << LOW_SEED_BITS | low


def row_seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """Return one seed for each of `count` robots: S, S + 1, S + 2, … for a number S; None lets a robot's run go on.

    Raises
    ------
    gymnasium.error.Error
        when a seed is negative or not a Python integer.
    WrongSeeds
        when a list has another length.
    """
    if seed is None:
        return [None] * count
    rows: Sequence[int | None] = [seed + row for row in range(count)] if isinstance(seed, int) else seed
    if len(rows) != count:
        raise WrongSeeds(f"{len(rows)} seeds: give one number, or one for each of the {count} robots")
    for one in rows:
        if one is not None and not (isinstance(one, int) and one >= 0):
            seeding.np_random(one)  # raises Gymnasium's own error
    return list(rows)


def reset_mask(options: dict[str, Any] | None, count: int) -> np.ndarray:
    """Return which robots to reset, bools of shape (count,): all unless the options have a "reset_mask".

    Raises
    ------
    TypeError, ValueError
        as SyncVectorEnv does, unless the mask is an array of `count` bools with at least one True.
    """
    if not options or "reset_mask" not in options:
        return np.ones(count, bool)
    mask = options["reset_mask"]
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        what = f"an array of {mask.dtype}" if isinstance(mask, np.ndarray) else type(mask).__name__
        raise TypeError(f"options['reset_mask'] is {what}; it must be a NumPy array of bools")
    if mask.shape != (count,) or not mask.any():
        what = "names no robot" if mask.shape == (count,) else f"has the shape {mask.shape}"
        raise ValueError(
            f"options['reset_mask'] {what}; it must have one bool for each of {count} robots, at least one of them True"
        )
    return mask.copy()


def given_poses(options: dict[str, Any] | None, arena: Arena, count: int = 1) -> dict[int, Pose]:
    """Return the poses (x, y in m, heading in rad) in the options, by robot; the options have one for all or each.

    Raises
    ------
    ValueError
        when a pose is not three finite numbers, or the robot has no room there.
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
