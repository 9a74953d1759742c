"""Counts the transitions that the machines take in a storm."""

from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from enum import StrEnum
from typing import Any
from unittest.mock import patch

from phototaxis.runtime import seat_client
from phototaxis.runtime.transitions import Transitions
from phototaxis_recorder import gathering
from phototaxis_sensors import sensing
from phototaxis_sim import phases

TABLES: dict[str, dict[Any, Any]] = {
    "sim": phases.TABLE,
    "seat client": seat_client.TABLE,
    "sensors": sensing.TABLE,
    "recorder": gathering.TABLE,
}


@contextmanager
def counting(taken: Counter[tuple[str, str, str]]) -> Generator[None]:
    """Count by machine, state and input what is taken meanwhile."""
    names, take = {id(table): name for name, table in TABLES.items()}, Transitions.take

    def counted(self: Transitions[Any, Any], given: StrEnum) -> StrEnum:
        taken[names[id(self._table)], str(self.state), str(given)] += 1
        return take(self, given)

    with patch.object(Transitions, "take", counted):
        yield


def table(taken: Counter[tuple[str, str, str]]) -> list[str]:
    """A line for each row of each machine that took part, with how often it was taken."""
    there = {name for name, _, _ in taken}
    return [
        f"{taken[name, str(state), str(given)]:10}  {name}: {state} -- {given} --> {after}"
        for name, rows in TABLES.items()
        if name in there
        for (state, given), after in rows.items()
    ]
