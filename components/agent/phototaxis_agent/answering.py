"""Answers the ticks of a world, with one robot or with many, behind one interface."""

from typing import Any, NamedTuple

from phototaxis.runtime.errors import UserError
from phototaxis.runtime.protocol import AnswerCache
from phototaxis.runtime.seat_client import Mode
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.wire.messages import World

from phototaxis_agent.batch_driver import BatchDriver


class Answering(NamedTuple):
    """An agent at the ticks of one world."""

    once: AnswerCache[Any]
    whole: bool
    """Whether the agent's checkpoint holds everything that its next answer depends on. Then a journal can continue
    it, and a successor can be its equal; of many robots it holds what was learned, not what each one remembers."""


def answering(world: World, agent: SeatedAgent) -> Answering:
    """What answers each tick of a world once, from the agent's last answer on."""
    if world.robots > 1:
        return Answering(AnswerCache(BatchDriver(agent, world.robots)), whole=False)
    return Answering(AnswerCache(agent, agent.tick, agent.command), whole=True)


def refuse_mode(world: World, mode: Mode) -> None:
    """Raise UserError where a world cannot be joined in this way."""
    if world.robots > 1 and mode == "stand by":
        raise UserError(f"a standby keeps in step with the driver of one robot; this world has {world.robots}")
