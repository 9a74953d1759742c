"""The backend of a vector environment that drives the robots of a running system."""

from collections.abc import Mapping, Sequence

import numpy as np
from gymnasium.error import Error
from phototaxis.task import BatchObservation
from phototaxis.wire.codec import Refused
from phototaxis.wire.columns import FLAG, pack, unpack
from phototaxis.wire.messages import BatchCommand, BatchReadings
from phototaxis_sim.physics import Pose

from phototaxis_gym.link import Link, refuse_poses

FOLLOW = "on the bus the robots' seeds are S, S + 1, S + 2, …"


class RemoteBatchBackend:
    """N robots on the bus."""

    poses = None

    def __init__(self, connect: str, world: str, timeout: float, count: int):
        self._link, self._count = Link(connect, world, timeout), count
        self.arena = self._link.world.arena
        if self._link.world.robots != count or count == 1:
            self._link.close()
            why = "for one robot, use gymnasium.make" if count == 1 else f"start it with --robots {count}"
            raise Error(f"the world '{world}' has {self._link.world.robots} robots, num_envs is {count}; {why}")

    @property
    def tick(self) -> int:
        return self._link.tick

    def begin(self, seeds: Sequence[int], starts: Mapping[int, Pose]) -> BatchObservation:
        """Begin a new run; the seeds must be S, S + 1, S + 2, …."""
        refuse_poses(starts)
        if list(seeds) != list(range(seeds[0], seeds[0] + self._count)):
            raise Error(f"{FOLLOW}: give reset one number")
        return self._senses(self._link.begin(seeds[0]))

    def drive(self, motors: np.ndarray, ends: np.ndarray) -> BatchObservation:
        left, right, end = pack(motors[0]), pack(motors[1]), pack(ends, FLAG)
        ident = self._link.ident
        return self._senses(
            self._link.answer(
                lambda run, tick: BatchCommand(run=run, tick=tick, author=ident, left=left, right=right, end=end)
            )
        )

    def renew(self, ends: np.ndarray, seeds: Mapping[int, int], starts: Mapping[int, Pose]) -> BatchObservation:
        """Begin new episodes of some robots; this takes one tick, in which the others stand still."""
        refuse_poses(starts)
        if seeds:
            raise Error(f"{FOLLOW}: give reset one number, and no reset_mask")
        return self.drive(np.zeros((2, self._count)), ends)

    def close(self) -> None:
        """Leave the seat and the bus."""
        self._link.close()

    def _senses(self, readings: BatchReadings) -> BatchObservation:
        try:
            sonar, light = unpack(readings.sonar, self._count, 16), unpack(readings.light, self._count, 2)
            front, rear = unpack(readings.contact, self._count, 2, FLAG).astype(bool)
        except Refused as why:
            raise Error(f"the sensors' readings cannot be used: {why}") from None
        return BatchObservation(sonar, light, front, rear)
