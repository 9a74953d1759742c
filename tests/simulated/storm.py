"""Runs schedules and compares each with the run in one process; a schedule that fails is made as short as it can be.

`make storm SEEDS=0:1000` runs a range of seeds.
"""

import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import joblib
import msgspec
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.errors import UserError
from phototaxis.wire.messages import World
from phototaxis_agent.agent import Agent
from phototaxis_agent.setup import make_setup
from phototaxis_lab.loop import train
from phototaxis_sim import arenas
from tqdm import tqdm

from simulated.process import Process
from simulated.schedule import Fault, Schedule, make
from simulated.system import BACK_AFTER_S, System
from simulated.witness import Broken

BEGINS_AFTER_S = 0.0005
"""Seconds after which a fault begins in its tick: some of its messages are on their way."""
LIMIT_S = 600.0
"""Virtual seconds within which every run ends."""


@cache
def _fresh(world: bytes) -> Agent:
    """An agent that has learned nothing."""
    return make_setup().agent(msgspec.msgpack.decode(world, type=World))


def fresh(world: World) -> Agent:
    """An agent that has learned nothing, from a copy: to look its learner up takes longer than a run's twenty ticks."""
    return deepcopy(_fresh(msgspec.msgpack.encode(world)))


@cache
def reference(world: int, epochs: int) -> tuple[str, str, int]:
    """State hash, learner hash and ticks of the run in one process."""
    loop, _ = train(make_setup(), arenas.load("paper"), world, epochs)
    state = loop.simulation.state
    return state.hash, loop.agent.checkpoint()[0].learner_hash, state.tick


class Storm:
    """One schedule as it is carried out.

    Attributes
    ----------
    counts : faults that happened, by kind, and the messages that were lost, doubled and reordered.
    """

    def __init__(self, schedule: Schedule, folder: Path):
        self.counts: Counter[str] = Counter()
        self._schedule, self._faults = schedule, list(schedule.faults)
        arena = arenas.load("paper")
        self._system = System(folder, schedule.seed, arena, fresh, schedule.world, schedule.epochs)
        self._system.network.weather = msgspec.structs.replace(schedule.weather)
        self._names = ["agent"]
        self._sim = self._system.simulation()
        self._sensors, self._agent = self._system.sensors(), self._system.agent("agent")

    def run(self) -> int:
        """Carry it out; the ticks of the run.

        Raises
        ------
        Broken
            when an invariant does not hold, the run does not end, or ends otherwise than in one process.
        """
        system, schedule = self._system, self._schedule
        system.witness.on_tick = self._begin_at
        system.timeline.after(BACK_AFTER_S, self._watch)
        if not system.finish(LIMIT_S):
            raise Broken(f"the run stands at tick {system.tick} after {LIMIT_S:g} s")
        state_hash, learner_hash, ticks = reference(schedule.world, schedule.epochs)
        if system.hash != state_hash:
            raise Broken("the state's hash is another than in one process")
        if load(system.checkpoint(system.driver or system.witness.author))[0].learner_hash != learner_hash:
            raise Broken("what was learned is another than in one process")
        self.counts.update({name: count for name, count in system.network.counts.items() if name != "sent"})
        return ticks

    def _watch(self) -> None:
        """Start again what has died."""
        system = self._system
        if self._sim.dead:
            self._sim = system.simulation()
        if self._sensors.dead:
            self._sensors = system.sensors()
        if self._agent.dead and not system.finished:
            mode = "claim" if len(self._names) == 1 else "take over"
            self._agent = system.agent(self._names[-1], mode, restarted=True)
        if not system.finished:
            system.timeline.after(BACK_AFTER_S, self._watch)

    def _begin_at(self, tick: int) -> None:
        """Begin the faults of a tick a moment after it is first asked for."""
        while self._faults and self._faults[0].tick <= tick:
            self._system.timeline.after(BEGINS_AFTER_S, self._begin, self._faults.pop(0))

    def _begin(self, fault: Fault) -> None:
        self.counts[fault.kind] += 1
        if fault.kind == "swap":
            agent = self._agent  # one that dies before it hands over takes what it knows with it
            if not agent.dead and agent.kill_in is None and self._system.driver == agent.ident:
                self._swap()
            return
        process = {"sim": self._sim, "sensors": self._sensors, "agent": self._agent}[fault.kind.split()[1]]
        if fault.kind.startswith("kill"):
            process.kill_in, process.tear = fault.effects, fault.tear
        elif not process.dead:
            process.frozen = True
            self._system.timeline.after(fault.seconds, process.thaw)

    def _swap(self) -> None:
        """An agent of the same kind takes over; from now on it is the one that faults befall."""
        self._names.append(f"agent-{len(self._names) + 1}")
        self._agent: Process = self._system.agent(self._names[-1], "take over")


def run(schedule: Schedule) -> tuple[str, int, Counter[str]]:
    """What is wrong ("" for nothing), the ticks, and the faults by kind.

    Wrong is what breaks an invariant or is told to users as an error; any other exception is a defect of the harness.
    """
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:  # noqa: S108
        try:
            storm = Storm(schedule, Path(folder))
            return "", storm.run(), storm.counts
        except (Broken, UserError) as error:
            return f"{type(error).__name__}: {error}", 0, Counter()


def results(seeds: range) -> Iterator[tuple[int, tuple[str, int, Counter[str]]]]:
    """Each seed with what `run` says of its schedule, on all cores."""
    parallel: Any = joblib.Parallel  # its stubs know neither numbers for batch_size nor generators
    return parallel(n_jobs=-1, batch_size=8, return_as="generator")(joblib.delayed(_numbered)(s) for s in seeds)


def _numbered(seed: int) -> tuple[int, tuple[str, int, Counter[str]]]:
    return seed, run(make(seed))


def shrink(schedule: Schedule) -> Schedule:
    """The schedule without the faults that it fails without."""
    for fault in reversed(schedule.faults):
        fewer = msgspec.structs.replace(schedule, faults=[one for one in schedule.faults if one is not fault])
        if run(fewer)[0]:
            schedule = fewer
    return schedule


def main(words: list[str]) -> int:
    first, _, last = (words[0] if words else "0:200").partition(":")
    seeds = range(int(first), int(last) if last else int(first) + 1)
    began, ticks, failed, faults = time.perf_counter(), 0, 0, Counter[str]()
    for seed, (wrong, made, counts) in tqdm(results(seeds), total=len(seeds), unit=" schedules"):
        ticks, faults = ticks + made, faults + counts
        if wrong:
            failed += 1
            print(f"seed {seed}: {wrong}\n  {shrink(make(seed))}", flush=True)
    seconds = time.perf_counter() - began
    rate = f"{ticks / seconds:.0f} ticks/s, {len(seeds) / seconds:.1f} schedules/s"
    print(f"{len(seeds)} schedules, {ticks} ticks, {failed} failed; {rate}; {dict(sorted(faults.items()))}")
    return 1 if failed else 0
