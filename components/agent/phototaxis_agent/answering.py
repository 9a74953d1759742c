"""What answers the ticks of a world: one robot's agent or one for many, behind one interface."""

from typing import Any, NamedTuple, Protocol

import numpy as np
from phototaxis.arena import Arena
from phototaxis.checkpoint import Meta
from phototaxis.errors import UserError
from phototaxis.messages import Command, World
from phototaxis.protocol import Once
from phototaxis.seat_client import Mode
from phototaxis.task import TaskOptions

from phototaxis_agent.many import Flock


class Learning(Protocol):
    """A learner that can be tried before the process ends."""

    def prove(self, arrays: dict[str, np.ndarray]) -> None: ...


class Answerer(Protocol):
    """What the bus needs of an agent."""

    author: str
    """The name on the bus under which it answers."""

    def __call__(self, readings: Any) -> Any: ...
    @property
    def name(self) -> str: ...
    @property
    def task(self) -> TaskOptions: ...
    @property
    def learner(self) -> Learning: ...
    @property
    def last(self) -> Any: ...
    @property
    def visits(self) -> list[int]: ...
    @property
    def command(self) -> Command | None: ...
    @property
    def tick(self) -> tuple[str, int]: ...
    def enter(self, arena: Arena) -> None: ...
    def checkpoint(self) -> tuple[Meta, dict[str, np.ndarray]]: ...
    def restore(self, meta: Meta, arrays: dict[str, np.ndarray], source: str) -> None: ...
    def table(self) -> list[float]: ...
    def current(self) -> list[float]: ...


class Answering(NamedTuple):
    """An agent at the ticks of one world."""

    once: Once[Any]
    whole: bool
    """Whether the agent's checkpoint holds everything that its next answer depends on. Then a journal can continue
    it, and a successor can be its equal; of many robots it holds what was learned, not what each one remembers."""


def answering(world: World, agent: Any) -> Answering:
    """What answers each tick of a world once, from the agent's last answer on."""
    if world.robots > 1:
        return Answering(Once(Flock(agent, world.robots)), whole=False)
    return Answering(Once(agent, agent.tick, agent.command), whole=True)


def refuse_mode(world: World, mode: Mode) -> None:
    """Raise UserError where a world cannot be joined in this way."""
    if world.robots > 1 and mode == "stand by":
        raise UserError(f"a standby keeps in step with the driver of one robot; this world has {world.robots}")
