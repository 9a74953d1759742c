"""The backend of an environment that drives the robot of a running system."""

from gymnasium.error import Error
from phototaxis.wire.messages import Command, End, Readings
from phototaxis_sim.physics import Pose

from phototaxis_gym.link import Link, refuse_poses


class RemoteBackend:
    """One robot on the bus."""

    pose = None

    def __init__(self, connect: str, world: str, timeout: float):
        self._link = Link(connect, world, timeout)
        self.arena = self._link.world.arena
        if self._link.world.robots > 1:
            self._link.close()
            raise Error(f"the world '{world}' has {self._link.world.robots} robots: use gymnasium.make_vec")

    def begin(self, seed: int, start: Pose | None = None) -> Readings:
        """Begin a new run with this seed, and return its first readings."""
        refuse_poses(start)
        return self._link.begin(seed)

    def drive(self, left: float, right: float) -> Readings:
        return self._link.answer(
            lambda run, tick: Command(run=run, tick=tick, author=self._link.ident, left=left, right=right)
        )

    def place(self, end: End, start: Pose | None = None) -> Readings:
        refuse_poses(start)
        ident = self._link.ident
        return self._link.answer(
            lambda run, tick: Command(run=run, tick=tick, author=ident, left=0.0, right=0.0, end=end)
        )

    def close(self) -> None:
        """Leave the seat and the bus."""
        self._link.close()
