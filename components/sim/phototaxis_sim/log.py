"""Makes the simulation's log: one row for each tick, and a message from a chunk of rows."""

from collections.abc import Callable
from typing import Any

from phototaxis.runtime.machine import Record
from phototaxis.wire.messages import EndedEpisode, SimLog, State


def row(state: State, ended: tuple[EndedEpisode, ...], late: int) -> Record:
    """One tick, with the episodes that ended before it and the ticks so far that had no command in time."""
    contact = state.front + 2 * state.rear
    return Record(
        (state.run, state.driver),
        (state.tick, state.episode, state.time, state.x, state.y, state.heading, state.left, state.right, contact,
         ended, late),
    )  # fmt: skip


def chunks(writer: str) -> Callable[[int, tuple[Any, ...], list[Any]], SimLog]:
    """Makes the messages of the writer's log."""

    def chunk(seq: int, head: tuple[Any, ...], columns: list[Any]) -> SimLog:
        tick, episode, seconds, x, y, heading, left, right, contact, ended, late = map(list, columns)
        return SimLog(
            run=head[0], seq=seq, writer=writer, driver=head[1], tick=tick, episode=episode, time=seconds, x=x, y=y,
            heading=heading, left=left, right=right, contact=contact,
            ended=[one for some in ended for one in some], late=late[-1],
        )  # fmt: skip

    return chunk
