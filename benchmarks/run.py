"""`make bench`: measures rates and costs on this machine.

Each round measures every rate once, and a rate is the median over rounds, so that other load disturbs all rates alike.
Compare ratios rather than single figures.
"""

import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import environments
import fmu
import handover
import msgspec
import numpy as np
from phototaxis.geometry.arena import Arena, Disc, Light
from phototaxis.runtime.ports import free_ports
from phototaxis.task import PERCEPTS
from phototaxis.wire.codec import Decoder, encode
from phototaxis.wire.messages import Command, Message, Readings, State, World
from phototaxis_agent.batch_agent import BatchAgent
from phototaxis_agent.learner import Transition, available_learners
from phototaxis_agent.setup import make_setup
from phototaxis_lab.cell import Cell, System
from phototaxis_lab.grid import summary
from phototaxis_lab.loop import Loop, train
from phototaxis_lab.measure import measure
from phototaxis_lab.parallel import outcomes
from phototaxis_sensors.light import LightModel
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.sonar import SonarModel
from phototaxis_sim import arenas
from phototaxis_sim.physics import Physics, Pose

ROUNDS = 5
EPOCHS = 3000
BUS_EPOCHS = 10_000
SETUP = make_setup()


def main() -> None:
    paper = arenas.load("paper")
    crowded = with_obstacles(paper, 1000)
    rounds: list[dict[str, float]] = []
    for number in range(ROUNDS):
        print(f"round {number + 1} of {ROUNDS}", file=sys.stderr, flush=True)
        rounds.append(
            {
                "in-process, epochs/s": in_process(paper),
                "in-process with 1,000 obstacles, epochs/s": in_process(crowded),
                "bare ring of three processes, ticks/s": ring(),
                "four processes with recorder, ticks/s": over_the_bus(),
                "three processes, no recorder, ticks/s": over_the_bus("--no-recorder"),
            }
        )
    rates = {name: statistics.median(one[name] for one in rounds) for name in rounds[0]}
    print("\nRates (median of", ROUNDS, "rounds, lowest and highest)")
    for name, rate in rates.items():
        values = [one[name] for one in rounds]
        print(f"  {name:45} {rate:9,.0f}   ({min(values):,.0f} to {max(values):,.0f})")

    print("\nRatios (median of the rounds' own ratios)")
    for name, ratio in ratios(rounds).items():
        print(f"  {name:60} {ratio:5.2f}")

    print("\nWhen the driver changes, median of", ROUNDS, "rounds; no tick is lost")
    print("\n".join(handover.lines(ROUNDS)))

    print("\nLearning: Q-table, simple percept, 3,000 epochs, seeds 0 to 19, 200 fresh placements each")
    found = [outcome for _, outcome in outcomes([Cell(System("qtable"), 3000, seed) for seed in range(20)])]
    for name, value in summary(found).items():
        print(f"  {name:60} {value}")

    print("\nTraining in one process, steps/s: median of", ROUNDS, "rounds, and the learner's own share of a step, µs")
    for name, rate, own in learners(paper):
        print(f"  {name:25} {rate:9,.0f} {own:9.1f}")

    print("\nMany robots in one process (evaluations), robot steps/s: physics, sensors, percept, a table's draws")
    for count, rate in batches(paper):
        print(f"  {count:5} robots {rate:12,.0f}")

    environments.report()

    print("\nSensor models from FMUs")
    fmu.report(paper)

    print("\nCost of one tick by part, in one process, µs")
    bus = 1e6 / rates["four processes with recorder, ticks/s"] - 1e6 / rates["in-process, epochs/s"]
    for name, cost in {**parts(paper), "bus: a tick over it less a step in one process": bus}.items():
        print(f"  {name:65} {cost:7.1f}")


def learners(arena: Arena) -> list[tuple[str, float, float]]:
    """Measure each learner with each of its percepts: training steps/s, and µs of one `values` and one `learn`."""
    rows = []
    every = [(name, percept) for name in available_learners() for percept in ("simple", "rich")] + [
        ("dqn", "continuous")
    ]
    for name, percept in every:
        setup = make_setup(name, percept=percept)
        rate = statistics.median(1000 / train(setup, arena, number, 1000)[1] for number in range(ROUNDS))
        learner = setup.agent(World(run="bench", arena=arena, seed=1, epochs=0)).learner
        state = tuple(0 * size for size in PERCEPTS[percept].sizes) + learner.context
        step = Transition(state, 3, 0.01, state, False, 0.5, False)
        own = cost(partial(learner.values, state), 300) + cost(partial(learner.learn, step), 300)
        rows.append((f"{name}, {percept}", rate, own))
    return rows


def batches(arena: Arena) -> list[tuple[int, float]]:
    """Measure the robot steps/s of evaluations with different numbers of robots."""
    policy = SETUP.agent(World(run="bench", arena=arena, seed=1, epochs=0), learning=False).policy
    rows = []
    for count in (1, 16, 256, 4096):
        rates = []
        for number in range(ROUNDS):
            began = time.perf_counter()
            found = measure(
                arena, BatchAgent(policy, arena.sensing.near, count, number), count, number, max_episode_steps=30
            )
            rates.append(30 * found.placements / (time.perf_counter() - began))
        rows.append((count, statistics.median(rates)))
    return rows


def ratios(rounds: list[dict[str, float]]) -> dict[str, float]:
    """Return the medians of ratios, each computed from figures of the same round."""

    def median(ratio: Callable[[dict[str, float]], float]) -> float:
        return statistics.median(map(ratio, rounds))

    def efficiency(run: str) -> Callable[[dict[str, float]], float]:
        return lambda r: (1 / r["bare ring of three processes, ticks/s"] + 1 / r["in-process, epochs/s"]) * r[run]

    plain, crowded = "in-process, epochs/s", "in-process with 1,000 obstacles, epochs/s"
    recorded, bare = "four processes with recorder, ticks/s", "three processes, no recorder, ticks/s"
    return {
        "bus efficiency with recorder: (ring + in-process) / measured": median(efficiency(recorded)),
        "bus efficiency without recorder": median(efficiency(bare)),
        "rate with recorder / without": median(lambda r: r[recorded] / r[bare]),
        "slower with 1,000 obstacles": median(lambda r: r[plain] / r[crowded]),
    }


def with_obstacles(arena: Arena, count: int) -> Arena:
    """Return a hall of 60 × 60 m with round pillars at random places and the light in its middle."""
    rng = np.random.default_rng(0)
    pillars: list[Disc] = []
    while len(pillars) < count:
        x, y = rng.uniform(0, 60, 2).tolist()
        if math.hypot(x - 30, y - 30) > 2:
            pillars.append(Disc((x, y), 0.2))
    return msgspec.structs.replace(arena, size=(60.0, 60.0), lights=[Light((30.0, 30.0))], discs=pillars)


def in_process(arena: Arena) -> float:
    """Measure the epochs/s of the loop in one process: physics, 16 sonars, lights, Q-table."""
    return EPOCHS / train(SETUP, arena, 1, EPOCHS)[1]


def ring() -> float:
    """Measure the ticks/s of the bare ring."""
    script = str(Path(__file__).with_name("ring.py"))
    return float(subprocess.run([sys.executable, script, "10000"], capture_output=True, check=True).stdout)


def over_the_bus(*words: str) -> float:
    """Measure the ticks/s of `phototaxis up` in lockstep."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "phototaxis_launcher", "up", "--json", "--name=bench", f"--out={folder}",
            f"--epochs={BUS_EPOCHS}", "--seed=1", "--grpc-port=0", "--web-port=-1", *words,
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, check=True)
        return json.loads(done.stdout.splitlines()[-1])["ticks_per_second"]


def parts(arena: Arena) -> dict[str, float]:
    """Measure the cost of each part of one tick, µs."""
    loop = Loop(arena, SETUP.agent(World(run="bench", arena=arena, seed=1, epochs=0)), 1)
    for _ in range(500):
        loop.step()
    state = loop.simulation.state
    readings = loop.sensors(state)
    command = loop.agent(readings)
    physics, scene = Physics(arena), Scene(arena)
    physics.place(Pose(3, 3, 0))
    sonar, light = SonarModel(arena, scene), LightModel(arena, scene)
    costs = {
        "physics: 5 steps": cost(lambda: physics.drive(0.5, -0.5)),
        "16 sonars": cost(lambda: sonar(state)),
        "2 light sensors": cost(lambda: light(state)),
        "sensor suite (sonar, light, noise, message)": cost(lambda: loop.sensors(state)),
        "the same while three processes take turns on pipes": taking_turns(),
        "agent (percept, reward, learning, action, message)": cost(lambda: agent_step(loop, readings)),
        "of which the learner (equation 1 and nine values)": cost(lambda: learner_step(loop)),
    }
    messages: list[tuple[Message, Any]] = [(state, State), (readings, Readings), (command, Command)]
    decoders = [Decoder(kind, 4096) for _, kind in messages]
    payloads = [encode(message) for message, _ in messages]
    sizes = ", ".join(f"{kind.__name__} {len(payload)}" for (_, kind), payload in zip(messages, payloads, strict=True))
    print(f"  (messages: {sizes} bytes)")
    costs["encode three messages"] = cost(lambda: [encode(message) for message, _ in messages])
    costs["decode and validate three messages"] = cost(
        lambda: [decode(payload) for decode, payload in zip(decoders, payloads, strict=True)]
    )
    costs["recorder: translate, batches of 400 ticks (in its own process)"] = recorder_cost(arena, loop)
    return costs


def agent_step(loop: Loop, readings: Readings) -> None:
    """Run one step of the agent, on readings that follow its previous ones."""
    readings.tick += 1
    readings.episode = readings.tick // 50
    readings.author, readings.left, readings.right = "a", 1.0, 0.0
    loop.agent(readings)


def learner_step(loop: Loop) -> None:
    """Call the learner as the agent does in one step."""
    loop.agent.learner.values((0, 0, 0, 0))
    loop.agent.learner.learn(Transition((0, 0, 0, 0), 3, 0.01, (1, 0, 0, 0), False, 0.5, False))


def taking_turns() -> float:
    """Measure the µs of the sensor suite when two other processes run in between: the cost of cold caches."""
    command = [sys.executable, str(Path(__file__).with_name("turns.py"))]
    return float(subprocess.run(command, capture_output=True, check=True).stdout)


def recorder_cost(arena: Arena, loop: Loop) -> float:
    """Measure the µs per tick to write log chunks as Rerun columns to disk."""
    from phototaxis.wire.messages import AgentLog, SensorsLog, SimLog
    from phototaxis_recorder.sinks import RecordingSinks

    ticks, chunk, began = 8000, 16, 0.0
    with tempfile.TemporaryDirectory() as folder:
        world = World(run="bench", arena=arena, seed=1, epochs=0)
        recording = RecordingSinks(world, Path(folder) / "b.rrd", "127.0.0.1", free_ports(1)[0], "64MiB")
        translator = recording.translator
        began = time.perf_counter()
        for first in range(0, ticks, chunk):
            tick, ones = list(range(first, first + chunk)), [1.0] * chunk
            zeros = [0] * chunk
            translator.sim(SimLog(
                run="b", seq=0, writer="w", driver="d", tick=tick, episode=zeros, time=ones, x=ones, y=ones,
                heading=ones, left=ones, right=ones, contact=zeros, ended=[],
            ))  # fmt: skip
            translator.sensors(SensorsLog(
                run="b", seq=0, writer="w", sonar_model="", light_model="", tick=tick, sonar=[1.0] * 16 * chunk,
                light=[0.1] * 2 * chunk,
            ))  # fmt: skip
            translator.agent(AgentLog(
                run="b", seq=0, writer="w", learner="qtable", percept="simple", tick=tick, state=zeros, action=zeros,
                reward=ones, td_error=ones, temperature=ones,
            ))  # fmt: skip
            if first % 400 == 0:
                translator.flush()
                recording.keep()
        translator.flush(last=True)
        recording.keep()
        seconds = time.perf_counter() - began
        recording.close()
    return seconds / ticks * 1e6


def cost(call: Callable[[], Any], times: int = 2000) -> float:
    """Return the µs of a call: the median of five batches."""
    batches = []
    for _ in range(5):
        began = time.perf_counter()
        for _ in range(times):
            call()
        batches.append((time.perf_counter() - began) / times * 1e6)
    return statistics.median(batches)


if __name__ == "__main__":
    main()
