"""The states of a machine: a table maps each state and input to the next state."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Generic, TypeVar

StateT = TypeVar("StateT", bound=StrEnum)
InputT = TypeVar("InputT", bound=StrEnum)


class Transitions(Generic[StateT, InputT]):
    """The state of one machine, which only the rows of its table can change.

    Parameters
    ----------
    table : the next state for each allowed pair of state and input.
    state : the first state.
    """

    def __init__(self, table: Mapping[tuple[StateT, InputT], StateT], state: StateT):
        self._table, self.state = table, state

    def take(self, given: InputT) -> StateT:
        """Take one input, and return the new state.

        Raises
        ------
        KeyError
            when the table has no row for this state and input: a defect of the machine.
        """
        self.state = self._table[self.state, given]
        return self.state


def diagram(table: Mapping[tuple[StateT, InputT], StateT]) -> str:
    """The table as a Mermaid state diagram; inputs that lead from one state to the same next one share an arrow."""
    arrows: dict[tuple[StateT, StateT], list[str]] = {}
    for (state, given), after in table.items():
        if after != state:
            arrows.setdefault((state, after), []).append(given.value)
    lines = [f"    {_word(a)} --> {_word(b)}: {', '.join(inputs)}" for (a, b), inputs in arrows.items()]
    return "\n".join(["```mermaid", "stateDiagram-v2", *lines, "```"])


def _word(state: StrEnum) -> str:
    return state.value.replace(" ", "_")
