"""Connects instances of an FMU to a robot's sensors: how many, with which inputs, and how outputs become readings."""

from collections.abc import Sequence
from typing import Protocol

from phototaxis.geometry.arena import Arena
from phototaxis_sensors.light import Sights
from phototaxis_sensors.model import Moment, SensorModel

from phototaxis_fmu.wiring import Wiring, size


class Rig(Protocol):
    """The instances for one kind of sensor."""

    instances: int

    def feed(self, moment: Moment) -> list[float]:
        """Return the inputs of all instances, in the FMU's units."""
        ...

    def collect(self, outputs: Sequence[float]) -> Sequence[float]:
        """Return the readings; `outputs` are those of all instances, in our units."""
        ...


class Lamps:
    """A light model: one instance for each sensor and lamp; a sensor's outputs are summed and clipped to 0..1."""

    ORDER = "distance", "bearing", "brightness", "visibility"

    def __init__(self, wiring: Wiring, arena: Arena, sights: Sights):
        self._sights, self._lamps = sights, len(arena.lights)
        self.instances = len(arena.robot.light_sensors) * self._lamps
        self._places = [(self.ORDER.index(wire.port), wire.factor, wire.offset) for wire in wiring.inputs]

    def feed(self, moment: Moment) -> list[float]:
        found: list[float] = []
        for sensor in self._sights(moment):
            for sight in sensor:
                ours = sight.distance, sight.bearing, sight.brightness, float(sight.visible)
                found += [factor * ours[place] + offset for place, factor, offset in self._places]
        return found

    def collect(self, outputs: Sequence[float]) -> Sequence[float]:
        return _clip(sum(outputs[: self._lamps]), 1.0), _clip(sum(outputs[self._lamps :]), 1.0)


class Filters:
    """A filter behind the built-in light model: one instance for each sensor."""

    def __init__(self, wiring: Wiring, builtin: SensorModel):
        self._builtin, self._wire = builtin, wiring.inputs[0]
        self.instances = 2

    def feed(self, moment: Moment) -> list[float]:
        return [self._wire.factor * reading + self._wire.offset for reading in self._builtin(moment)]

    def collect(self, outputs: Sequence[float]) -> Sequence[float]:
        return [_clip(reading, 1.0) for reading in outputs]


class Beams:
    """A sonar model: one instance for all beams, or one for each; readings are clipped to the sonar range."""

    def __init__(self, wiring: Wiring, arena: Arena, builtin: SensorModel):
        self._builtin, self._farthest = builtin, arena.robot.sonar_range
        self.instances = len(arena.robot.sonars) // wiring.width
        self._wires = [wire for wire in wiring.inputs for _ in range(size(wire))] * self.instances

    def feed(self, moment: Moment) -> list[float]:
        ranges = self._builtin(moment)
        return [wire.factor * distance + wire.offset for wire, distance in zip(self._wires, ranges, strict=True)]

    def collect(self, outputs: Sequence[float]) -> Sequence[float]:
        return [_clip(distance, self._farthest) for distance in outputs]


def _clip(value: float, most: float) -> float:
    return min(max(0.0, value), most)
