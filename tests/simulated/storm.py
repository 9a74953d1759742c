"""Carries out one schedule on a whole system, and compares its end with the run in one process."""

from collections import Counter
from collections.abc import Callable
from copy import deepcopy
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path

import msgspec
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.seat_client import Mode
from phototaxis.wire.messages import World
from phototaxis_agent.agent import Agent
from phototaxis_agent.setup import make_setup
from phototaxis_lab.loop import Loop, train
from phototaxis_sim import arenas

from simulated.faults import ACTS, lasts
from simulated.process import Process
from simulated.schedule import Fault, Schedule
from simulated.system import BACK_AFTER_S, System
from simulated.witness import Broken

BEGINS_AFTER_S = 0.0005
"""Seconds after which a fault begins in its tick: some of its messages are on their way."""
LIMIT_S = 600.0
"""Virtual seconds within which every run ends."""
GOES_ON_WITHIN_S = 15.0
"""Virtual seconds within which the next tick comes when all faults have ended: a seat is kept for an heir (3 s), a
silent driver is waited for (5 s), a predecessor is asked (4 s), and lost messages are repeated."""
QUESTIONS_WITHIN_S = 60.0
"""So much longer it may take where queries are lost, too: each of some four is put again after 2 s."""


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


@cache
def reference_begun(world: int, epochs: int, begun: tuple[tuple[int, int], ...]) -> tuple[str, str]:
    """The hashes when other runs are begun: each by its seed, after the last tick learned in the one before."""
    arena = arenas.load("paper")
    agent = make_setup().agent(World(run="lab", arena=arena, seed=world, epochs=epochs))
    loop = Loop(arena, agent, world, epochs)
    for number, (learned, seed) in enumerate(begun):
        while loop.simulation.state.tick < learned:
            loop.step()
        loop.finish()
        agent.enter(arena)
        loop = Loop(arena, agent, seed, epochs, f"lab.{number}")
    while not loop.simulation.finished:
        loop.step()
    loop.finish()
    return loop.simulation.state.hash, agent.checkpoint()[0].learner_hash


class Storm:
    """One schedule as it is carried out.

    Attributes
    ----------
    counts : faults that happened, by kind, and the messages that were lost, doubled, reordered and cut off.
    """

    def __init__(self, schedule: Schedule, folder: Path):
        self.counts: Counter[str] = Counter()
        self._schedule, self._faults = schedule, list(schedule.faults)
        arena = arenas.load("paper")
        self.system = System(folder, schedule.seed, arena, fresh, schedule.world, schedule.epochs)
        self.system.network.weather = msgspec.structs.replace(schedule.weather)
        self._processes: dict[str, Process] = {}
        """The simulation and the sensors by role, agents by name; of agents those that are started again."""
        self._agents = 0
        self._reserved: dict[tuple[str, int], list[int]] = {}
        """At which ticks an agent was seen to have reserved a simulation's seat."""
        self._moved, self._calm_at = ("", 0.0), 0.0
        for role, start in (("sim", self.system.simulation), ("sensors", self.system.sensors)):
            self.system.timeline.after(schedule.late.get(role, 0.0), self._start, role, start)
        self.system.timeline.after(schedule.late.get("agent", 0.0), self._join)

    def run(self) -> int:
        """Carry it out; the ticks of the run.

        Raises
        ------
        Broken
            when an invariant does not hold, the run does not end, or ends otherwise than in one process.
        """
        system = self.system
        system.witness.on_tick = self._begin_at
        system.timeline.after(BACK_AFTER_S, self._watch)
        if not system.finish(LIMIT_S):
            raise Broken(f"the run stands at tick {system.tick} after {LIMIT_S:g} s")
        if self._schedule.theme != "real time":
            self._compare()
        self.counts.update({name: count for name, count in system.network.counts.items() if name != "sent"})
        return system.tick

    def of(self, role: str) -> Process:
        """The process that faults of a role befall; of agents the one that drives, else the newest."""
        if role == "agent":
            names = [name for name in self._processes if name.startswith("agent")]
            return self._processes[self.system.driver if self.system.driver in names else names[-1]]
        return self._processes[role]

    def may_die(self, process: Process) -> bool:
        """Whether it can be continued: by its journal, if it keeps one, and a driver's standby, if there is one."""
        disk = self.system.disks.get(process.ident)
        if disk is not None and (disk.full or not disk.kept):
            return False
        return process.role != "agent" or self._schedule.theme != "standby" or self.standby_is_named()

    def standby_is_named(self) -> bool:
        """Whether the simulation would seat a standby that lives, were its driver gone."""
        steps = self.system.steps
        others = {} if steps is None else {name: self._processes.get(name) for name in steps.seat.waiting}
        return any(one is not None and not one.dead and one.kill_in is None for one in others.values())

    def take_over(self) -> None:
        """An agent of the same kind takes over; from now on it is the one that faults befall."""
        former = self.of("agent").ident
        self._join()
        self._forget(former)

    def replace_driver(self) -> None:
        """Forget an agent that has died for good; another one stands by."""
        for name in [name for name, one in self._processes.items() if one.role == "agent" and one.dead]:
            self._forget(name)
        self._join()

    def _forget(self, agent: str) -> None:
        """An agent is not started again."""
        self._processes.pop(agent, None)
        self.system.witness.former.add(agent)

    @cached_property
    def operator(self) -> Process:
        """Who puts requests to the simulation."""
        return self.system.operator()

    def _start(self, role: str, start: Callable[[], Process]) -> None:
        self._processes[role] = start()

    def _join(self) -> None:
        """Another agent comes."""
        self._agents += 1
        name = f"agent-{self._agents}"
        self._processes[name] = self.system.agent(name, self._mode)
        if self._schedule.theme == "standby" and self._agents == 1:
            self._join()

    @property
    def _mode(self) -> Mode:
        if self._schedule.theme == "standby":
            return "stand by"
        return "claim" if self._agents == 1 else "take over"

    def _watch(self) -> None:
        """Start again what has died, and see that the run goes on."""
        system, now = self.system, self.system.timeline.now
        if system.finished:
            return
        for name, process in self._processes.items():
            if process.dead:
                self._processes[name] = self._again(name, process.role)
        self._see_reserved()
        if self._moved[0] != system.hash:
            self._moved = system.hash, now
        within = GOES_ON_WITHIN_S + (QUESTIONS_WITHIN_S if self._schedule.weather.query_loss else 0.0)
        if now - max(self._moved[1], self._calm_at) > within:
            raise Broken(f"nothing has happened for {within:g} s, at tick {system.tick}")
        system.timeline.after(BACK_AFTER_S, self._watch)

    def _see_reserved(self) -> None:
        """See that who takes over is seated at a tick's boundary; one that asks again asks less often than we look."""
        steps, before = self.system.steps, self._reserved
        if steps is not None:
            waits = {(agent, id(steps.seat)): before.get((agent, id(steps.seat)), []) for agent in steps.seat.reserved}
            self._reserved = {who: [*ticks, steps.tick] for who, ticks in waits.items()}
            for (agent, _), ticks in self._reserved.items():
                if len(ticks) > 3 and all(b > a + 1 for a, b in pairwise(ticks[-4:])):
                    raise Broken(f"{agent} is not seated although ticks go by")

    def _again(self, name: str, role: str) -> Process:
        if role == "agent":
            return self.system.agent(name, self._mode, restarted=True)
        return self.system.simulation() if role == "sim" else self.system.sensors()

    def _begin_at(self, tick: int) -> None:
        """Begin the faults of a tick a moment after it is first asked for."""
        while self._faults and self._faults[0].tick <= tick:
            self.system.timeline.after(BEGINS_AFTER_S, self._begin, self._faults.pop(0))

    def _begin(self, fault: Fault) -> None:
        if not (self._agents and {"sim", "sensors"} <= self._processes.keys()):  # somebody is late
            self.system.timeline.after(BACK_AFTER_S, self._begin, fault)
            return
        self.counts[fault.kind] += 1
        self._calm_at = max(self._calm_at, self.system.timeline.now + lasts(fault))
        verb, *words = fault.kind.split()
        ACTS[verb](self, fault, *words)

    def _compare(self) -> None:
        """Compare the end of the run with the same run in one process."""
        system, schedule, learned = self.system, self._schedule, self.system.witness.learned
        seeds = [fault.number for fault in schedule.faults if fault.kind == "begin"]
        if schedule.theme == "begin" and len(seeds) == 1:
            state_hash, learner_hash = reference_begun(
                schedule.world, schedule.epochs, tuple((tick, seeds[0]) for tick in learned)
            )
        elif seeds:
            return
        else:
            state_hash, learner_hash, _ = reference(schedule.world, schedule.epochs)
        if system.hash != state_hash:
            raise Broken("the state's hash is another than in one process")
        if load(system.checkpoint(system.driver or system.witness.author))[0].learner_hash != learner_hash:
            raise Broken("what was learned is another than in one process")
