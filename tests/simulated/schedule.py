"""A schedule: a world, a network and a list of faults. A seed makes one; taking faults away leaves a schedule."""

from random import Random
from typing import Literal, get_args

from msgspec import Struct

from simulated.network import Weather

Kind = Literal["kill sim", "kill agent", "kill sensors", "freeze sim", "freeze agent", "freeze sensors", "swap"]
KINDS: tuple[Kind, ...] = get_args(Kind)


class Fault(Struct, frozen=True):
    """Something that happens when the run has come to a tick."""

    tick: int
    kind: Kind
    effects: int = 0
    """kill: so many effects are still carried out."""
    tear: float | None = None
    """kill: an entry that is being written to the journal is torn at this share of its bytes."""
    seconds: float = 0.0
    """freeze: for so long."""


class Schedule(Struct, kw_only=True):
    """All that decides what happens."""

    seed: int
    world: int
    """The world's seed."""
    epochs: int
    weather: Weather
    faults: list[Fault]


def make(seed: int, worlds: int = 4, epochs: int = 150) -> Schedule:
    """The schedule of a seed: up to eight faults on a network that is quiet, lossy, or worse."""
    rng = Random(seed)
    weather = Weather(
        latency=10 ** rng.uniform(-4, -1.5),
        loss=rng.choice((0.0, 0.0, 0.02, 0.2)),
        double=rng.choice((0.0, 0.05, 0.3)),
        reorder=rng.choice((0.0, 0.05, 0.3)),
    )
    faults = sorted((_fault(rng, epochs) for _ in range(rng.randint(0, 8))), key=lambda fault: fault.tick)
    return Schedule(seed=seed, world=rng.randrange(worlds), epochs=epochs, weather=weather, faults=faults)


def _fault(rng: Random, epochs: int) -> Fault:
    tear = rng.random() if rng.random() < 0.5 else None
    return Fault(rng.randrange(epochs), rng.choice(KINDS), rng.randrange(8), tear, rng.uniform(0.01, 1.5))
