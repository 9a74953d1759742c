"""A schedule: a world, a network and a list of faults. A seed makes one; taking faults away leaves a schedule."""

from random import Random
from typing import Literal

from msgspec import Struct

from simulated.network import Weather

Theme = Literal["one agent", "standby", "real time", "begin"]
"""one agent: one drives, and successors take over. standby: a second one stands by. real time: the clock and resets
change the trajectory. begin: a new run is begun by request."""

SHARES: dict[Theme, int] = {"one agent": 13, "standby": 4, "real time": 2, "begin": 1}
"""How many of twenty schedules have which theme."""
_PLACES = ("sim", "sensors", "agent")
_ANYWHERE = (
    *(f"{verb} {role}" for verb in ("kill", "freeze") for role in _PLACES),
    "restarts sim",
    "restarts sensors",
    "pause",
    "stray",
)
_CUTS = ("part sim sensors", "part sim agent", "part sensors agent", "part sim", "part sensors", "part agent")
_FULL = ("full sim", "full agent")
KINDS: dict[Theme, tuple[str, ...]] = {
    "one agent": (*_ANYWHERE, "restarts agent", *_CUTS, *_FULL, "swap", "swap", "swap"),
    "standby": (*_ANYWHERE, "lose driver", "lose driver", "hang driver", *_FULL),
    "real time": (*_ANYWHERE, "restarts agent", *_CUTS, "swap", "speed", "speed", "reset", "reset"),
    "begin": (
        *(kind for kind in (*_ANYWHERE, *_CUTS) if kind != "kill agent"), "begin", "begin",
    ),
}  # fmt: skip
"""What may happen under each theme. What a fault does stands in `faults.py`, under its first word."""


EPOCHS = 150
"""Of a run, where nothing else is said."""
WORLDS = 4
"""Seeds of worlds: what a world's run in one process ends with is computed once."""


class Fault(Struct, frozen=True):
    """Something that happens when the run has come to a tick."""

    tick: int
    kind: str
    effects: int = 0
    """kill: so many effects are still carried out."""
    tear: float | None = None
    """kill: an entry that is being written to the journal is torn at this share of its bytes."""
    seconds: float = 0.0
    """What lasts goes on for so long."""
    number: int = 0
    """restarts: so often; pause: so many single steps; speed: so many times real time; begin: the new run's seed."""


class Schedule(Struct, kw_only=True):
    """All that decides what happens."""

    seed: int
    world: int
    """The world's seed."""
    epochs: int
    weather: Weather
    faults: list[Fault]
    theme: Theme = "one agent"
    late: dict[str, float] = {}
    """Seconds after which a role's first process starts; those that are not named start at once."""


def make(seed: int, epochs: int = EPOCHS) -> Schedule:
    """The schedule of a seed for a run of `epochs`: up to eight faults on a network that is quiet, lossy, or worse."""
    rng = Random(seed)
    theme: Theme = rng.choice([theme for theme, share in SHARES.items() for _ in range(share)])
    weather = Weather(
        latency=10 ** rng.uniform(-4, -1.5),
        loss=rng.choice((0.0, 0.0, 0.02, 0.2)),
        query_loss=rng.choice((0.0, 0.0, 0.0, 0.1)),
        double=rng.choice((0.0, 0.05, 0.3)),
        reorder=rng.choice((0.0, 0.05, 0.3)),
    )
    if theme == "standby":  # a standby that missed readings cannot know what a dead driver learned from them
        weather.loss = weather.reorder = 0.0
    late = {role: rng.uniform(0, 1.5) for role in _PLACES if rng.random() < 0.1}
    faults = sorted((_fault(rng, theme, epochs) for _ in range(rng.randint(0, 8))), key=lambda fault: fault.tick)
    return Schedule(
        seed=seed, world=rng.randrange(WORLDS), epochs=epochs, weather=weather, faults=faults, theme=theme, late=late
    )


def _fault(rng: Random, theme: Theme, epochs: int) -> Fault:
    tear = rng.random() if rng.random() < 0.5 else None
    return Fault(
        rng.randrange(epochs),
        rng.choice(KINDS[theme]),
        rng.randrange(8),
        tear,
        rng.uniform(0.01, 1.5),
        rng.randint(1, 6),
    )
