"""Measures the cost of an FMU per tick, and how well learners do with it. For `make bench`; needs gcc, g++ and make."""

import os
import statistics
import tempfile
import time
from pathlib import Path

from phototaxis.geometry.arena import Arena
from phototaxis.runtime.fmu import FmuOptions
from phototaxis_agent.setup import make_setup
from phototaxis_fmu.build import build
from phototaxis_fmu.examples import EXAMPLES
from phototaxis_lab.loop import train
from phototaxis_lab.measure import evaluate
from phototaxis_sensors.choice import choose_sensors
from phototaxis_sensors.model import PastMoment
from phototaxis_sensors.scene import Scene

TICKS = 5000
SEEDS = range(10)
EPOCHS = 3000


def costs(arena: Arena, folder: Path) -> dict[str, float]:
    """Measure the µs for both light readings, with the built-in model and with FMUs (FMI 2 and 3).

    All stay on one CPU, as the sensors do in a run with an FMU; the times include the switch of process.
    """
    here = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    found = {"built-in": _cost(arena, FmuOptions())}
    for name in ("light", "photodiode", "lag"):
        for version in (2, 3):
            file = folder / f"{name}{version}.fmu"
            build(EXAMPLES[name], version, file)
            found[f"{name}.fmu, FMI {version}"] = _cost(arena, FmuOptions(light_fmu=str(file)))
    if here is not None:
        os.sched_setaffinity(0, here)
    return found


def _cost(arena: Arena, options: FmuOptions) -> float:
    places = [(1 + 8 * (i * 0.618 % 1), 1 + 8 * (i * 0.414 % 1), i * 0.1) for i in range(TICKS)]
    rounds = []
    with choose_sensors(options, one_cpu=True) as make:
        light = make(arena, Scene(arena)).light
        for number in range(5):
            began = time.perf_counter()
            for tick, place in enumerate(places, number * TICKS):
                light(PastMoment(tick, tick // 50, *place))
            rounds.append((time.perf_counter() - began) / TICKS * 1e6)
    return statistics.median(rounds)


def learners(arena: Arena, folder: Path) -> dict[tuple[str, str], list[float]]:
    """Measure the success on 200 fresh placements of each (learner, sensor), one rate for each seed.

    The learner trains and is measured with the same sensor.
    """
    found = {}
    for learner in ("qtable", "mirror"):
        for name, options in _sensors(folder).items():
            found[learner, name] = [_success(arena, learner, options, seed) for seed in SEEDS]
    return found


def _sensors(folder: Path) -> dict[str, FmuOptions]:
    files = {name: str(folder / f"{name}3.fmu") for name in ("lag", "photodiode")}
    return {
        "built-in": FmuOptions(),
        "lag.fmu, 0.2 s": FmuOptions(light_fmu=files["lag"]),
        "lag.fmu, 1 s": FmuOptions(light_fmu=files["lag"], fmu_param=["tau=1"]),
        "photodiode.fmu": FmuOptions(light_fmu=files["photodiode"]),
    }


def _success(arena: Arena, learner: str, options: FmuOptions, seed: int) -> float:
    with choose_sensors(options) as sensors:
        loop, _ = train(make_setup(learner), arena, seed, EPOCHS, sensors)
        loop.agent.policy.learning = False
        return evaluate(arena, loop.agent.policy, 200, seed, sensors=sensors).success_rate


def report(arena: Arena) -> None:
    """Print both tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        table = costs(arena, folder)
        print("two light readings, µs a tick (on one CPU, with the process boundary)")
        for name, microseconds in table.items():
            print(f"  {name:24}{microseconds:8.1f}   {microseconds - table['built-in']:+.1f}")
        print(f"learners with FMUs: {EPOCHS:,} epochs, {len(SEEDS)} seeds, 200 fresh placements each")
        for (learner, sensor), rates in learners(arena, folder).items():
            print(f"  {learner:8}{sensor:18} median {statistics.median(rates):6.1%}   worst {min(rates):6.1%}")


if __name__ == "__main__":
    from phototaxis_sim import arenas

    report(arenas.load("paper"))
