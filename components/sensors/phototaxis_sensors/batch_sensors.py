"""The sensor suites of many robots on the bus: from the columns of a state to those of readings."""

from collections.abc import Sequence

import numpy as np
from phototaxis.wire.columns import FLAG, pack, unpack
from phototaxis.wire.messages import BatchReadings, BatchState

from phototaxis_sensors.batch_suite import BatchSuite
from phototaxis_sensors.model import BuiltIn, Moment


class BatchSensors:
    """Readings of N robots as a pure function of (world, state); `suite` casts their rays."""

    stateful = False
    names = BuiltIn.name, BuiltIn.name

    def __init__(self, suite: BatchSuite, robots: int):
        self._suite, self._robots = suite, robots

    def __call__(self, state: BatchState) -> BatchReadings:
        """Answer one tick.

        Raises
        ------
        Refused
            when a column is not of this many robots.
        """
        poses = unpack(state.pose, self._robots, 3)
        unpack(state.contact, self._robots, 2, FLAG)
        sonar, light = self._suite(state.tick, np.ascontiguousarray(poses.T))
        return BatchReadings(
            run=state.run, tick=state.tick, epoch=state.epoch, episode=state.episode, sonar=pack(sonar),
            light=pack(light), contact=state.contact, left=state.left, right=state.right, author=state.author,
            driver=state.driver,
        )  # fmt: skip

    def first(self, readings: BatchReadings) -> tuple[list[float], Sequence[float]]:
        """The ranges and lights of the first robot."""
        sonar, light = unpack(readings.sonar, self._robots, 16), unpack(readings.light, self._robots, 2)
        return sonar[:, 0].tolist(), light[:, 0].tolist()

    def follow(self, moment: Moment) -> None:
        """No-op: the models are pure functions of the pose."""

    def begun_anew(self, tick: int) -> None:
        """No-op: the models do not depend on earlier ticks."""
