"""The sensors on the bus: answer each state with its readings."""

import time
from itertools import chain
from typing import Any, NamedTuple

from phototaxis.bus import Bus
from phototaxis.chunks import Chunks
from phototaxis.messages import Readings, SensorsLog, State
from phototaxis.protocol import Once

from phototaxis_sensors.suite import SensorSuite


class Session(NamedTuple):
    """The sensors in one run."""

    run: str
    sense: Once[Readings]


class Server:
    """Readings for every state of whatever run is on the bus."""

    def __init__(self, bus: Bus):
        self._bus = bus
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
            elif event.topic == "log/sensors":
                self._log.answer(event)
            elif event.topic == "stop":
                self._log.flush()
                return

    def _answer(self, state: State) -> None:
        session = self._meet(state.run)
        readings = session.sense(state) if session else None
        if readings is None:
            return
        readings.driver = state.driver  # the seat may change while a tick is asked again
        self._bus.put("readings", readings)
        if state.tick > self._newest:
            self._newest = state.tick
            self._log.add((state.run, state.tick, readings.sonar, readings.light), time.monotonic())

    def _meet(self, run: str) -> Session | None:
        """The sensors of a run; None when its world is not to be had now (the state will come again)."""
        if self._session is not None and self._session.run == run:
            return self._session
        world = self._bus.ask_one("world")
        if world is None or world.run != run:
            return None
        self._log.flush()
        self._newest = -1
        self._session = Session(run, Once(SensorSuite(world)))
        return self._session

    def _chunk(self, seq: int, columns: list[Any]) -> SensorsLog:
        runs, ticks, sonars, lights = columns
        sonar, light = list(chain.from_iterable(sonars)), list(chain.from_iterable(lights))
        return SensorsLog(runs[0], seq, self._bus.ident, ticks, sonar, light)
