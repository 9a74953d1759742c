"""Uses FMUs as the sensors of many robots: all instances are stepped together, in one process where possible."""

import numpy as np
from phototaxis.wire.messages import World
from phototaxis_sensors.batch_suite import BatchSuite

from phototaxis_fmu.model import Stepped
from phototaxis_fmu.rigs import Lamps
from phototaxis_fmu.wiring import Wiring, size


class InstanceBatch:
    """Steps the instances for one kind of sensor of N robots.

    Parameters
    ----------
    stepped : the instances, robot by robot.
    wiring : the connections of one instance.
    """

    def __init__(self, stepped: Stepped, wiring: Wiring):
        self._stepped = stepped
        self.ports = [wire.port for wire in wiring.inputs]
        sizes = list(map(size, wiring.inputs))
        self._factor = np.repeat([wire.factor for wire in wiring.inputs], sizes)
        self._offset = np.repeat([wire.offset for wire in wiring.inputs], sizes)

    def __call__(self, tick: int, ours: np.ndarray) -> np.ndarray | None:
        """Return the outputs of all instances, robot by robot, in our units; None after the FMU was given up."""
        inputs = ours.reshape(-1, len(self._factor)) * self._factor + self._offset
        outputs = self._stepped(0, tick, inputs.ravel().tolist())
        return None if outputs is None else np.array(outputs)


class FmuBatch(BatchSuite):
    """Computes the readings of N robots, with FMUs for sonar, light or both; for one episode, tick by tick."""

    def __init__(self, world: World, sonar: InstanceBatch | None, light: InstanceBatch | None):
        super().__init__(world)
        self._sonar_instances, self._light_instances, self._tick = sonar, light, 0

    def __call__(self, tick: int, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return sonars (16, N) in m and lights (2, N) in 0..1 at poses (N, 3)."""
        self._tick = tick
        return super().__call__(tick, poses)

    def _sonar(self, poses: np.ndarray) -> np.ndarray:
        ranges = super()._sonar(poses)
        if self._sonar_instances is None:
            return ranges
        farthest = self._arena.robot.sonar_range
        found = self._sonar_instances(self._tick, np.minimum(ranges, farthest).T)
        return ranges if found is None else np.clip(found.reshape(len(poses), -1).T, 0.0, farthest)

    def _light(self, poses: np.ndarray) -> np.ndarray:
        instances = self._light_instances
        if instances is None:
            return super()._light(poses)
        ours = super()._light(poses).T if instances.ports == ["raw"] else self._sights(poses, instances.ports)
        found = instances(self._tick, ours)
        if found is None:
            return super()._light(poses)
        return np.clip(found.reshape(len(poses), 2, -1).sum(axis=2).T, 0.0, 1.0)

    def _sights(self, poses: np.ndarray, ports: list[str]) -> np.ndarray:
        """Return the inputs of the instances, shape (robots, sensors, lamps, ports)."""
        lamps = []
        for light in self._arena.lights:
            east, north, distance, visible = self.sight(light, poses)
            bearing = np.angle(np.exp(1j * (np.arctan2(north, east) - poses[:, 2])))
            known = distance, bearing, np.full_like(distance, light.brightness), visible
            lamps.append(np.stack([known[Lamps.ORDER.index(port)] for port in ports]))
        return np.stack(lamps).transpose(3, 2, 0, 1)
