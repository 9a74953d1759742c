"""The sensors on the bus: answer each state with its readings."""

import sys
import time
from itertools import chain
from typing import Any, NamedTuple

from phototaxis.bus import Bus
from phototaxis.chunks import Chunks
from phototaxis.codec import Decoder, Refused
from phototaxis.columns import unpack
from phototaxis.messages import LogRequest, Readings, ReadingsOfMany, SensorsLog, SimLog, State, StateOfMany, World
from phototaxis.protocol import Once
from phototaxis.topics import TOPICS

from phototaxis_sensors.choice import Choice
from phototaxis_sensors.many import SuiteOfMany
from phototaxis_sensors.model import BuiltIn, Past
from phototaxis_sensors.suite import SensorSuite


class Session(NamedTuple):
    """The sensors in one run."""

    run: str
    suite: SensorSuite
    sense: Once[Readings]


class Server:
    """Readings for every state of whatever run is on the bus.

    Models that remember (FMUs) are first led through what the simulation's log tells of the episode.
    """

    def __init__(self, bus: Bus, make: Choice):
        self._bus, self._make = bus, make
        self._many: tuple[World, Once[ReadingsOfMany]] | None = None
        self._models = (BuiltIn.name, BuiltIn.name)
        self._session: Session | None = None
        self._newest = -1
        self._log = Chunks(bus, "log/sensors", self._chunk)

    def serve(self) -> None:
        """Answer until a "stop" event."""
        while True:
            event = self._bus.receive(timeout=0.05)
            if event is None:
                self._log.poll(time.monotonic())
            elif event.topic == "state":
                self._answer(event.message)
            elif event.topic == "crowd/state":
                self._answer_many(event.message)
            elif event.topic == "log/sensors":
                self._log.answer(event)
            elif event.topic == "stop":
                self._log.flush()
                return

    def _answer(self, state: State) -> None:
        session = self._meet(state)
        if session is None:
            return
        readings = session.sense(state)
        if readings is None:
            return
        readings.driver = state.driver  # the seat may change while a tick is asked again
        self._bus.put("readings", readings)
        if state.tick > self._newest:
            self._newest = state.tick
            models = session.suite.models.sonar.name, session.suite.models.light.name
            if models != self._models:  # a chunk has one set of models
                self._log.flush()
                self._models = models
            self._log.add((state.run, state.tick, readings.sonar, readings.light), time.monotonic())

    def _answer_many(self, state: StateOfMany) -> None:
        if self._many is None or self._many[0].run != state.run:
            world = self._bus.ask_one("world")
            if world is None or world.run != state.run:
                return None
            self._log.flush()
            self._newest = -1
            self._many = world, Once(SuiteOfMany(world, self._make))
            self._say(f"senses for {world.robots} robots in the run {state.run}")
        try:
            readings = self._many[1](state)
        except Refused as why:
            return self._bus.refuse("crowd/state", str(why))
        if readings is None:
            return None
        readings.driver = state.driver
        self._bus.put("crowd/readings", readings)
        if state.tick > self._newest:
            self._newest = state.tick
            robots = self._many[0].robots
            sonar, light = unpack(readings.sonar, robots, 16), unpack(readings.light, robots, 2)
            self._log.add((state.run, state.tick, sonar[:, 0].tolist(), light[:, 0].tolist()), time.monotonic())
        return None

    def _meet(self, state: State) -> Session | None:
        """The sensors of a run; None when its world is not to be had now (the state will come again)."""
        if self._session is not None and self._session.run == state.run:
            return self._session
        world = self._bus.ask_one("world")
        if world is None or world.run != state.run:
            return None
        self._log.flush()
        self._newest = -1
        suite = SensorSuite(world, self._make)
        if any(model.remembers for model in suite.models):
            self._recall(suite, state)
        self._session = Session(state.run, suite, Once(suite))
        self._say(f"senses in the run {state.run}")
        return self._session

    def _say(self, text: str) -> None:
        print(f"{self._bus.ident}: {text}", file=sys.stderr, flush=True)

    def _recall(self, suite: SensorSuite, now: State) -> None:
        """Lead the models through the earlier ticks of the episode, which the simulation's log has."""
        decode, past = Decoder(SimLog, TOPICS["log/sim"].limit), dict[int, Past]()
        for payload in self._bus.ask("log/sim", LogRequest()):
            try:
                chunk = decode(payload)
            except Refused as why:
                self._bus.refuse("log/sim", str(why))
                continue
            columns = zip(chunk.tick, chunk.episode, chunk.x, chunk.y, chunk.heading, strict=True)
            past.update({row[0]: Past(*row) for row in columns if chunk.run == now.run and row[0] < now.tick})
        episode = [past[tick] for tick in sorted(past) if past[tick].episode == now.episode]
        for moment in episode:
            suite.follow(moment)
        began = episode[0].tick if episode else now.tick
        if began and (began - 1 not in past or past[began - 1].episode == now.episode):
            for model in suite.models:
                model.begun_anew(began)

    def _chunk(self, seq: int, columns: list[Any]) -> SensorsLog:
        runs, ticks, sonars, lights = columns
        sonar, light = list(chain.from_iterable(sonars)), list(chain.from_iterable(lights))
        return SensorsLog(
            run=runs[0],
            seq=seq,
            writer=self._bus.ident,
            sonar_model=self._models[0],
            light_model=self._models[1],
            tick=ticks,
            sonar=sonar,
            light=light,
        )
