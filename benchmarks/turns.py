"""Measures the sensor suite while two other processes run it in turn, to show what separate processes cost.

The processes take turns over pipes, without Zenoh; each finds the CPU's caches and branch predictors as the others
left them. It prints the median in µs.
"""

import os
import statistics
import subprocess
import sys
import time
from typing import BinaryIO, cast

from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim import arenas
from phototaxis_sim.simulation import Simulation

ROUNDS = 3000


def main() -> None:
    simulation = Simulation(arenas.load("paper"), 1, "bench")
    suite, state = SensorSuite(simulation.world), simulation.advance(1.0, 1.0, "bench")
    if len(sys.argv) > 1:  # this is one of the two other processes
        while os.read(0, 1):
            suite(state)
            os.write(1, b"x")
        return
    others = [
        subprocess.Popen([sys.executable, __file__, "other"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        for _ in range(2)
    ]
    times = []
    for _ in range(ROUNDS):
        for other in others:
            cast(BinaryIO, other.stdin).write(b"x")
            cast(BinaryIO, other.stdout).read(1)
        began = time.perf_counter()
        suite(state)
        times.append(time.perf_counter() - began)
    for other in others:
        cast(BinaryIO, other.stdin).close()
        other.wait()
    print(statistics.median(times) * 1e6)


if __name__ == "__main__":
    main()
