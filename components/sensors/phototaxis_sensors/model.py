"""What a sensor model is: readings without noise, tick by tick."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

BUILT_IN = "built-in"


class Moment(Protocol):
    """Where the robot is at one tick: a `State`, or the part of it that sensor models read."""

    @property
    def tick(self) -> int: ...
    @property
    def episode(self) -> int: ...
    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...
    @property
    def heading(self) -> float: ...


class Past(NamedTuple):
    """A moment that is over."""

    tick: int
    episode: int
    x: float
    y: float
    heading: float


class SensorModel(Protocol):
    """One kind of sensor. It may remember earlier ticks of the episode; each tick is asked once, in order."""

    @property
    def name(self) -> str:
        """For the recording."""
        ...

    def __call__(self, moment: Moment) -> Sequence[float]:
        """The readings: 16 ranges in m, or two lights in 0..1."""
        ...
