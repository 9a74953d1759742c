"""Defects put into the machines on purpose: the simulated network must notice each."""

import struct
from collections.abc import Callable
from typing import NamedTuple

import msgspec
import numpy as np
from phototaxis.runtime.journal import Journal
from phototaxis.runtime.machine import Append
from phototaxis.runtime.protocol import AnswerCache, RetransmitTimer
from phototaxis.runtime.seat_client import SeatClient
from phototaxis_agent.agent import Agent
from phototaxis_agent.client import AgentClient
from phototaxis_agent.following import Following
from phototaxis_agent.keeping import Keeping
from phototaxis_agent.policy import Policy
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim.seat import Seat
from phototaxis_sim.simulation import Simulation
from phototaxis_sim.stepper import Stepper
from phototaxis_sim.steps import Steps

LENGTH = struct.Struct("<II")
DARK = [(0.0, 0.0)] * 5


class Mutation(NamedTuple):
    """One defect: where it is put, and what stands there instead."""

    about: str
    where: type
    name: str
    make: Callable[[Callable], Callable]
    """From the right method to the wrong one."""


def _later(right):
    def drive(self, *given):
        effects = right(self, *given)
        return sorted(effects, key=lambda effect: type(effect).__name__ != "Publish")

    return drive


def _again(right):
    return lambda self, question: self._answer(question)


def _restored_without(**lost):
    def make(right):
        def restore(self, meta, arrays, source):
            right(self, msgspec.structs.replace(meta, **lost), arrays, source)

        return restore

    return make


def _other_random(right):
    def restore(self, meta, arrays, source):
        drawn = np.random.default_rng(1).bit_generator.state
        right(self, meta, arrays, source)
        self._rng.bit_generator.state = drawn

    return restore


def _torn_is_whole(right):
    def read(self):
        frames = right(self)
        data = self.path.read_bytes() if self.path.exists() else b""
        rest = data[sum(LENGTH.size + len(frame) for frame in frames) :]
        return [*frames, rest[LENGTH.size :]] if len(rest) > LENGTH.size else frames

    return read


def _drifting(right):
    count = iter(range(10**9))

    def sense(self, state):
        readings = right(self, state)
        readings.sonar[0] += next(count) * 1e-9
        return readings

    return sense


def _taken_for(**fields):
    """Commands are taken as if these fields were right; each is made from the machine."""

    def make(right):
        def command(self, given):
            right(self, msgspec.structs.replace(given, **{name: of(self) for name, of in fields.items()}))

        return command

    return make


def _unwritten(right):
    def apply(self, entry):
        right(self, entry)
        self.out = [effect for effect in self.out if not isinstance(effect, Append)]

    return apply


def _nothing(right):
    return lambda self, *given: None


def _entries_lost(right):
    return lambda self, found: right(self, found._replace(entries=[]))


def _chain_lost(right):
    return lambda self, at, *given: right(self, msgspec.structs.replace(at, chain=b"\0" * 8), *given)


def _any_author(right):
    def command(self, given):
        known = {change.driver for change in self.seat.history}
        author = self.seat.driver if given.author in known else given.author
        right(self, msgspec.structs.replace(given, author=author))

    return command


def _never_due(right):
    def due(self, now):
        self.repeat_at = float("inf")
        return False

    return due


def _left_out(right):
    def apply(self, entry):
        right(self, entry)
        if self.tick % 50 == 0 and not entry.end:
            self._advance(entry)

    return apply


MUTATIONS = [
    Mutation("publishes before the journal", AgentClient, "_drive", _later),
    Mutation("keeps no journal of the readings", Keeping, "entry", lambda _: lambda self, readings: []),
    Mutation("does not go through the journal again", Keeping, "_again", lambda _: lambda self, *given: iter(())),
    Mutation("learns from a repeated tick again", AnswerCache, "__call__", _again),
    Mutation("loses the percept's history with a checkpoint", Agent, "restore", _restored_without(lights=DARK)),
    Mutation("loses the step count of the episode", Agent, "restore", _restored_without(steps=0)),
    Mutation("loses the last state with a checkpoint", Agent, "restore", _restored_without(state=(0, 0, 0, 0))),
    Mutation("loses the random state with a checkpoint", Policy, "restore", _other_random),
    Mutation("takes a torn frame for a whole one", Journal, "read", _torn_is_whole),
    Mutation("inherits nothing", Following, "_inherit", lambda _: lambda self, reply, source: "nothing"),
    Mutation("applies the command of another tick", Steps, "command", _taken_for(tick=lambda self: self.tick)),
    Mutation("asks before the journal has what led there", Stepper, "on", _later),
    Mutation("keeps no journal of the commands", Steps, "apply", _unwritten),
    Mutation("begins no new journal with an episode", Steps, "_begin_journal", _nothing),
    Mutation("does not make the journal's commands again", Steps, "go_on", _entries_lost),
    Mutation("begins the chain of hashes anew", Simulation, "restore", _chain_lost),
    Mutation("sensors that are asked again sense otherwise", SensorSuite, "__call__", _drifting),
    Mutation("accepts a former driver's command", Steps, "command", _any_author),
    Mutation(
        "applies the command of another run", Steps, "command", _taken_for(run=lambda self: self.simulation.state.run)
    ),
    Mutation(
        "applies a command that comes from anybody", Steps, "command", _taken_for(author=lambda self: self.seat.driver)
    ),
    Mutation("never repeats a question", RetransmitTimer, "due", _never_due),
    Mutation("never seats a taker-over", Seat, "boundary", lambda _: lambda self, tick: False),
    Mutation("accepts stale readings", SeatClient, "stale", lambda _: lambda self, readings: False),
    Mutation("stands by before it is the driver's equal", SeatClient, "_ready", lambda _: lambda self, *given: True),
    Mutation("applies a command twice", Steps, "apply", _left_out),
    Mutation("forgets a pause", Stepper, "_resume", _nothing),
]
