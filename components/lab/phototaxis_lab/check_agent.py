"""Tests a live agent against the contract, clause by clause; this program acts as its simulation and sensors."""

import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.errors import ComponentFailed, Unavailable
from phototaxis.runtime.machine import Event
from phototaxis.runtime.options import flags
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.codec import encode
from phototaxis.wire.messages import Command, Control, ControlReply, Readings, Status, World, run_name
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim import arenas
from phototaxis_sim.simulation import Simulation

SILENCE_S = 0.5
"""Seconds to wait for a message that must not come."""


class Verdict(NamedTuple):
    """The result for one clause of the contract."""

    clause: str
    fault: str
    """How the agent breaks the clause; "" when it keeps it."""


def check(options: BusOptions, ticks: int, answer_timeout: float, agent_timeout: float) -> int:
    """Test the first agent that joins the world `options.name`, and print a line for each clause.

    Raises
    ------
    Unavailable
        when that world has a simulation already, or no agent joins within `agent_timeout` seconds.
    ComponentFailed
        when the agent breaks a clause.
    """
    _refuse_a_run(options)
    with (
        open_session("sim", options) as session,
        open_session("sensors", options) as other,
        Bus(session, options.name, "sim", "check") as sim,
        Bus(other, options.name, "sensors", "check") as sensors,
    ):
        line = f"waiting for an agent in the world '{options.name}', as: phototaxis agent {' '.join(flags(options))}"
        print(line.rstrip(), file=sys.stderr, flush=True)
        broken = 0
        for verdict in Trial(sim, sensors, answer_timeout, agent_timeout).run(ticks):
            broken += bool(verdict.fault)
            print(
                f"{'FAIL' if verdict.fault else 'pass'}  {verdict.clause}{': ' if verdict.fault else ''}{verdict.fault}"
            )
            sys.stdout.flush()
    if broken:
        raise ComponentFailed(f"the agent breaks {broken} clause{'s' if broken > 1 else ''} of the contract")
    return 0


def _refuse_a_run(options: BusOptions) -> None:
    """Raise Unavailable when there is a simulation already, since this check acts as one and two would conflict."""
    with open_session("observer", options) as session, Bus(session, options.name, "observer", "check") as bus:
        if bus.wait_for("sim", SILENCE_S):
            raise Unavailable(
                f"a run is up in the world '{options.name}', and this check must be the only simulation; give it and "
                "the agent a world of their own: --name trial"
            )


class Trial:
    """Tests one agent on all clauses."""

    def __init__(self, sim: Bus, sensors: Bus, answer_timeout: float, agent_timeout: float):
        self._sim, self._sensors, self._answer_timeout, self._agent_timeout = (
            sim,
            sensors,
            answer_timeout,
            agent_timeout,
        )
        self._world = World(run=run_name(), arena=arenas.load("paper"), seed=0, epochs=0)
        self._simulation = Simulation(self._world.arena, 0, self._world.run, 0)
        self._suite = SensorSuite(self._world)
        self._agent = ""
        self._asked: Readings | None = None
        self._answer = Command(run="", tick=0, author="", left=0.0, right=0.0)
        """The agent's last correct answer."""

    def run(self, ticks: int) -> Iterator[Verdict]:
        """Test the clauses in order; without a claim or a first answer, the others cannot be tested."""
        yield self._arrives()
        yield self._claims()
        if not self._agent:
            return
        first = Verdict("answers the first readings that name it the driver", self._first())
        yield first
        if first.fault:
            return
        yield Verdict("repeats its answer, byte for byte, when a tick is asked again", self._repeats())
        yield Verdict(f"answers {ticks} ticks once each, each within {self._answer_timeout:g} s", self._drives(ticks))
        yield Verdict("ends the episode when it has reached the light", self._reaches())
        yield Verdict("keeps silent about an older tick", self._older())
        yield Verdict("steps down when another one drives", self._steps_down())

    def _arrives(self) -> Verdict:
        if not self._sim.wait_for("agent", self._agent_timeout):
            raise Unavailable(
                f"no agent came within {self._agent_timeout:g} s; "
                "it must declare the liveliness token NAME/alive/agent/ID"
            )
        return Verdict("declares its liveliness token", "")

    def _claims(self) -> Verdict:
        """Publish readings that name no driver, again and again, until a claim comes."""
        self._ask("")
        self._await("control", self._agent_timeout)
        fault = "" if self._agent else f"no claim within {self._agent_timeout:g} s"
        return Verdict("claims a free seat", fault)

    def _first(self) -> str:
        self._ask(self._agent)
        return self._fault(self._await("command", self._agent_timeout))

    def _repeats(self) -> str:
        before = self._answer
        self._ask(self._agent)
        after = self._await("command", self._answer_timeout)
        if after is None:
            return "no answer"
        return "" if encode(before) == encode(after) else f"first {before}, then {after}"

    def _drives(self, ticks: int) -> str:
        for _ in range(ticks):
            answer = self._answer
            self._simulation.advance(answer.left, answer.right, answer.author, answer.end)
            self._ask(self._agent)
            began = time.monotonic()
            fault = self._fault(self._await("command", self._answer_timeout))
            if fault:
                return f"tick {self._simulation.state.tick}: {fault}"
            if time.monotonic() - began > self._answer_timeout:
                return f"tick {self._simulation.state.tick}: late"
        extra = self._await("command", SILENCE_S, repeat=False)
        return "" if extra is None else f"answered tick {extra.tick} twice without being asked again"

    def _reaches(self) -> str:
        answer = self._answer
        self._simulation.advance(answer.left, answer.right, answer.author, answer.end)
        self._ask(self._agent, light=(1.0, 1.0))
        command = self._await("command", self._answer_timeout)
        fault = self._fault(command)
        return fault or (
            "" if command is not None and command.end == "terminated" else f"its command does not end it: {command}"
        )

    def _older(self) -> str:
        if self._asked is None:
            return "nothing was asked"
        newest, self._asked = self._asked, None
        newest.tick -= 1
        self._sensors.put("readings", newest)
        command = self._await("command", SILENCE_S, repeat=False)
        newest.tick += 1
        return "" if command is None else f"it answered {command}"

    def _steps_down(self) -> str:
        self._simulation.advance(0.0, 0.0, self._agent, "terminated")
        self._ask("another")
        command = self._await("command", SILENCE_S)
        return "" if command is None else f"it answered {command}"

    def _ask(self, driver: str, light: tuple[float, float] | None = None) -> None:
        self._simulation.state.driver = driver
        readings = self._suite(self._simulation.state)
        if light is not None:
            readings.light = light
        self._asked = readings
        self._sensors.put("readings", readings)

    def _fault(self, command: Command | None) -> str:
        """Say what is wrong with an answer to the newest readings; "" if nothing is."""
        tick = self._simulation.state.tick
        if command is None:
            refused = "; ".join(f"{why} × {count}" for why, count in self._sim.refused.items())
            return f"no answer{f' ({refused})' if refused else ''}"
        for name, found, expected in (
            ("run", command.run, self._world.run),
            ("tick", command.tick, tick),
            ("author", command.author, self._agent),
        ):
            if found != expected:
                return f"{name} is {found!r}, not {expected!r}"
        self._answer = command
        return ""

    def _await(self, topic: str, timeout: float, repeat: bool = True) -> Command | None:
        """Wait for the next "command" and return it; or wait until the agent claims the seat ("control").

        Returns None after `timeout` seconds. While it waits for a claim, it repeats the readings.
        """
        deadline, again = time.monotonic() + timeout, time.monotonic() + 0.1
        while (left := deadline - time.monotonic()) > 0:
            event = self._sim.receive(timeout=min(left, 0.05))
            if event is not None and event.topic == "command" and topic == "command":
                return event.message
            if event is not None and event.reply is not None:
                self._reply(event)
            if topic == "control" and self._agent:
                return None
            if topic == "control" and repeat and self._asked is not None and time.monotonic() > again:
                again = time.monotonic() + 0.1
                self._sensors.put("readings", self._asked)
        return None

    def _reply(self, event: Event) -> None:
        if event.reply is None:
            return
        if event.topic == "world":
            event.reply(self._world)
        elif event.topic == "control" and isinstance(event.message, Control):
            request = event.message
            if request.verb in ("claim", "take over", "stand by"):
                self._agent = self._agent or request.agent
            event.reply(
                ControlReply(
                    ok=True, reason="", status=Status(run=self._world.run, phase="running", driver=self._agent)
                )
            )
