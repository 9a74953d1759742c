"""Which rows of a machine's table its scenarios take."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import Any

import pytest
from phototaxis.runtime.transitions import Transitions

Row = tuple[StrEnum, StrEnum]


def assert_all_taken(table: Mapping[Any, Any], scenarios: Iterable[Callable[[], object]]) -> None:
    """Run scenarios, print how often they take each row of a table, and fail where one is never taken."""
    taken, take = Counter[Row](), Transitions.take

    def counted(self: Transitions[Any, Any], given: StrEnum) -> StrEnum:
        taken[self.state, given] += 1
        return take(self, given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Transitions, "take", counted)
        for scenario in scenarios:
            scenario()
    for (state, given), after in table.items():
        print(f"{taken[state, given]:6}  {state} -- {given} --> {after}")
    assert [f"{state} -- {given}" for state, given in table if not taken[state, given]] == []
