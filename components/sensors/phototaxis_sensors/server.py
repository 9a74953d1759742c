"""The sensors on the bus: answer each state with its readings."""

import time
from typing import Any

from phototaxis.bus import Bus
from phototaxis.chunks import Chunks
from phototaxis.messages import Readings, SensorsLog, State, World
from phototaxis.protocol import Once

from phototaxis_sensors.suite import SensorSuite


class Server:
    """Readings for every state of whatever run is on the bus."""

    def __init__(self, bus: Bus):
        self._bus = bus
        self._run = ""
        self._once: Once[Readings] | None = None
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
        if state.run != self._run and not self._meet(state.run):
            return
        assert self._once is not None
        fresh = state.tick > self._tick
        readings = self._once(state)
        if readings is None:
            return
        readings.driver = state.driver  # the seat may change while a tick is asked again
        self._bus.put("readings", readings)
        if fresh:
            self._tick = state.tick
            self._log.add((state.tick, readings.sonar, readings.light), time.monotonic())

    def _meet(self, run: str) -> bool:
        """Learn the world of a run; False when it is not to be had now (the state will come again)."""
        world = self._bus.ask_one("world", World)
        if world is None or world.run != run:
            return False
        self._log.flush()
        self._run, self._tick = run, -1
        self._once = Once(SensorSuite(world))
        return True

    def _chunk(self, seq: int, columns: list[Any]) -> SensorsLog:
        ticks, sonars, lights = columns
        flat = [value for row in sonars for value in row]
        return SensorsLog(self._run, seq, self._bus.ident, ticks, flat, [value for row in lights for value in row])
