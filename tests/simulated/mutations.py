"""Defects put into the machines on purpose: the simulated network must notice each."""

import struct
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from phototaxis.journal import Journal
from phototaxis.protocol import Once
from phototaxis_agent.agent import Agent
from phototaxis_agent.client import AgentClient
from phototaxis_agent.following import Following
from phototaxis_agent.keeping import Keeping
from phototaxis_sensors.suite import SensorSuite

LENGTH = struct.Struct("<II")


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
    import msgspec

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


MUTATIONS = [
    Mutation("publishes before the journal", AgentClient, "_drive", _later),
    Mutation("keeps no journal of the readings", Keeping, "entry", lambda _: lambda self, readings: []),
    Mutation("does not go through the journal again", Keeping, "_again", lambda _: lambda self, *given: iter(())),
    Mutation("learns from a repeated tick again", Once, "__call__", _again),
    Mutation("loses the percept's history with a checkpoint", Agent, "restore", _restored_without(lights=[])),
    Mutation("loses the step count of the episode", Agent, "restore", _restored_without(steps=0)),
    Mutation("loses the last state with a checkpoint", Agent, "restore", _restored_without(state=())),
    Mutation("loses the random state with a checkpoint", Agent, "restore", _other_random),
    Mutation("takes a torn frame for a whole one", Journal, "read", _torn_is_whole),
    Mutation("inherits nothing", Following, "_inherit", lambda _: lambda self, reply, source: "nothing"),
    Mutation("sensors that are asked again sense otherwise", SensorSuite, "__call__", _drifting),
]
