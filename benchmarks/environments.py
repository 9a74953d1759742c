"""Measures the steps/s of the Gymnasium environments, in one process and on the bus. Part of `make bench`."""

import os
import secrets
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"
ROUNDS = 3


def single(steps: int = 5000, **where: Any) -> float:
    """Measure the steps/s of one environment with random actions, resets included."""
    environment = gymnasium.make(NAME, percept="sensors", **where)
    environment.reset(seed=0)
    actions = np.random.default_rng(0).integers(9, size=steps)
    began = time.perf_counter()
    for action in actions:
        _, _, terminated, truncated, _ = environment.step(action)
        if terminated or truncated:
            environment.reset()
    seconds = time.perf_counter() - began
    environment.close()
    return steps / seconds


def many(count: int, steps: int = 50_000, **where: Any) -> float:
    """Measure the robot steps/s of a vector environment with random actions, resets included."""
    robots = gymnasium.make_vec(NAME, num_envs=count, percept="sensors", **where)
    robots.reset(seed=0)
    turns = max(steps // count, 30)
    actions = np.random.default_rng(0).integers(9, size=(turns, count))
    began = time.perf_counter()
    for action in actions:
        robots.step(action)
    seconds = time.perf_counter() - began
    robots.close()
    return turns * count / seconds


@contextmanager
def system(robots: int) -> Iterator[dict[str, Any]]:
    """Run a simulation and sensors on this machine's sockets; gives the options that connect an environment to them."""
    world = f"bench-{secrets.token_hex(3)}"
    more = {"sim": [f"--robots={robots}"], "sensors": []}
    started = [
        subprocess.Popen([sys.executable, "-m", f"phototaxis_{role}", f"--name={world}", *words])
        for role, words in more.items()
    ]
    try:
        yield {"connect": "local", "world": world}
    finally:
        for process in started:
            process.terminate()
        for process in started:
            process.wait()


def behind_the_bus(count: int) -> float:
    """Measure the robot steps/s of an environment on the bus."""
    with system(count) as where:
        return single(**where) if count == 1 else many(count, **where)


def peer() -> float | None:
    """Measure the steps/s of aitk.robots with similar sensors; None unless AITK_PYTHON names a Python that has it."""
    python = os.environ.get("AITK_PYTHON")
    if not python:
        return None
    script = Path(__file__).with_name("peer.py")
    return float(subprocess.run([python, script], capture_output=True, check=True).stdout.split()[-1])


def report() -> None:
    """Print all rates: medians over rounds, each of which measures all of them."""
    measured = {
        "single environment": single,
        **{f"vector, {count:,} robots": lambda count=count: many(count) for count in (1, 16, 256, 4096)},
        **{f"behind the bus, {count:,} robots": lambda count=count: behind_the_bus(count) for count in (1, 16, 256)},
        **({"aitk.robots, one robot": peer} if os.environ.get("AITK_PYTHON") else {}),
    }
    rounds = [{name: measure() for name, measure in measured.items()} for _ in range(ROUNDS)]
    print("\nGymnasium, observation of all sensors, robot steps/s: median of", ROUNDS, "rounds")
    for name in measured:
        print(f"  {name:32} {statistics.median(one[name] or 0.0 for one in rounds):12,.0f}")


if __name__ == "__main__":
    report()
