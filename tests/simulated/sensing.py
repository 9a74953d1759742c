"""The built-in sensor models, which remember what they said of a pose: schedules of one world visit the same poses."""

from typing import Any

from msgspec.msgpack import encode
from phototaxis.geometry.arena import Arena
from phototaxis_sensors.choice import BuiltInFactory
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.suite import Models, SensorModel, built_in

_KNOWN: dict[bytes, Models] = {}
"""The models of each arena."""


class Remembered:
    """A model that is a pure function of the pose, asked once for each."""

    stateful = False

    def __init__(self, model: SensorModel):
        self._model, self._said = model, dict[tuple[float, float, float], Any]()
        self.name = model.name

    def __call__(self, moment: Any) -> Any:
        pose = moment.x, moment.y, moment.heading
        if pose not in self._said:
            self._said[pose] = tuple(self._model(moment))
        return self._said[pose]

    def begun_anew(self, tick: int) -> None:
        """Nothing depends on what was before."""


class RememberedChoice(BuiltInFactory):
    """Models that all schedules of a process share."""

    def __call__(self, arena: Arena, scene: Scene) -> Models:
        key = encode(arena)
        if key not in _KNOWN:
            _KNOWN[key] = Models(*(Remembered(model) for model in built_in(arena, scene)))
        return _KNOWN[key]
