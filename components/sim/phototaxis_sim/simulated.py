"""The interface through which the step protocol drives a simulation of one robot or of many."""

from typing import Any, Protocol

from phototaxis.wire.messages import EndedEpisode, State, World

from phototaxis_sim.simulation import Snapshot


class Simulated(Protocol):
    """A run from tick to tick."""

    @property
    def world(self) -> World: ...
    @property
    def state(self) -> Any:
        """The present tick as it is published: a `State` or a `BatchState`."""
        ...

    @property
    def ended(self) -> EndedEpisode | None:
        """The (first robot's) episode that ended in the last `advance`."""
        ...

    @property
    def outcomes(self) -> list[bool]:
        """Whether the light was reached, for each episode that ended in the last `advance`."""
        ...

    @property
    def episodes(self) -> int:
        """Episodes that have ended."""
        ...

    @property
    def reached(self) -> int:
        """Episodes that ended at the light."""
        ...

    @property
    def finished(self) -> bool:
        """Whether the last epoch has been made; its state is still to be answered."""
        ...

    @property
    def watched(self) -> State:
        """The (first) robot, for people to watch."""
        ...

    def check(self, command: Any) -> None:
        """Raise `Refused` for a command that cannot be applied."""
        ...

    def advance(self, left: Any, right: Any, author: str, end: Any = "") -> Any:
        """Apply a command, or end episodes; the next state."""
        ...

    def anew(self, seed: int, run: str) -> "Simulated":
        """Another run in the same arena."""
        ...

    def snapshot(self, recent: list[bool], driver: str) -> Snapshot | None:
        """What a journal begins with at an episode's first tick; None where a run cannot be continued."""
        ...
