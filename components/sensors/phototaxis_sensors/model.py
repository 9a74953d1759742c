"""The interface of a sensor model, which computes readings without noise, tick by tick."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol


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


class PastMoment(NamedTuple):
    """A moment that is over."""

    tick: int
    episode: int
    x: float
    y: float
    heading: float


class BuiltIn:
    """What the built-in models have in common: they are pure functions of the pose."""

    name = "built-in"
    stateful = False

    def begun_anew(self, tick: int) -> None:
        """No-op: the model does not depend on earlier ticks."""


class SensorModel(Protocol):
    """One kind of sensor."""

    @property
    def name(self) -> str:
        """Name of the model, for the recording."""
        ...

    @property
    def stateful(self) -> bool:
        """Whether earlier ticks of the episode matter; then each tick is to be asked once, in order."""
        ...

    def begun_anew(self, tick: int) -> None:
        """Begin at this tick of an episode, although its earlier ticks are unknown."""

    def __call__(self, moment: Moment) -> Sequence[float]:
        """The readings: 16 ranges in m, or two lights in 0..1."""
        ...
