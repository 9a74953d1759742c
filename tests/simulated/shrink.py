"""Makes a schedule that fails as short and as simple as it can be, so that a person can read what goes wrong in it."""

import re
from collections.abc import Callable, Iterator
from typing import TypeVar

from msgspec.structs import replace

from simulated.network import Weather
from simulated.schedule import Fault, Schedule

T = TypeVar("T")
CALM = {"loss": 0.0, "query_loss": 0.0, "double": 0.0, "reorder": 0.0, "latency": 0.001}
"""What a network without faults has."""
SIMPLE = {"effects": 0, "tear": None, "number": 1, "seconds": 0.01}
"""What a fault has that needs no number to be understood."""
SPARE_EPOCHS = 20
"""Epochs that a shortened run goes on after its last fault."""


def shrink(schedule: Schedule, run: Callable[[Schedule], str]) -> Schedule:
    """The simplest schedule found that fails as this one does; `run` says how one fails, "" where it does not."""
    kind = _kind(run(schedule))

    def fails(candidate: Schedule) -> bool:
        return _kind(run(candidate)) == kind

    schedule = replace(schedule, faults=ddmin(schedule.faults, lambda faults: fails(replace(schedule, faults=faults))))
    simpler = True
    while simpler:
        simpler = next(filter(fails, _simpler(schedule)), None)
        schedule = simpler or schedule
    return schedule


def ddmin(items: list[T], fails: Callable[[list[T]], bool]) -> list[T]:
    """The items without those that a failure does not need (A. Zeller, R. Hildebrandt, IEEE TSE 28, 2002, figure 3).

    No item of the result can be left out alone.
    """
    parts = 2
    while items and not (len(items) == 1 and not fails([])):
        size = -(-len(items) // parts)
        rests = (items[:at] + items[at + size :] for at in range(0, len(items), size))
        rest = next(filter(fails, rests), None)
        if rest is not None:
            items, parts = rest, max(parts - 1, 2)
        elif parts >= len(items):
            break
        else:
            parts = min(2 * parts, len(items))
    return items


def _kind(wrong: str) -> str:
    """A failure without its numbers."""
    return re.sub(r"\d+", "#", wrong)


def _simpler(schedule: Schedule) -> Iterator[Schedule]:
    """Schedules with one thing less."""
    for name, calm in CALM.items():
        if getattr(schedule.weather, name) != calm:
            yield replace(schedule, weather=replace(schedule.weather, **{name: calm}))
    for role in schedule.late:
        yield replace(schedule, late={one: at for one, at in schedule.late.items() if one != role})
    for index, fault in enumerate(schedule.faults):
        for name, simple in SIMPLE.items():
            if getattr(fault, name) != simple:
                faults = [*schedule.faults]
                faults[index] = replace(fault, **{name: simple})
                yield replace(schedule, faults=faults)
    last = max((fault.tick for fault in schedule.faults), default=0)
    if last + SPARE_EPOCHS < schedule.epochs:
        yield replace(schedule, epochs=last + SPARE_EPOCHS)


def told(schedule: Schedule) -> str:
    """A schedule in a few lines: what differs from a quiet run without faults."""
    weather = {name: getattr(schedule.weather, name) for name in Weather.__struct_fields__}
    rough = [f"{name} {value:.3g}" for name, value in weather.items() if value != CALM[name]]
    lines = [
        f"world {schedule.world}, {schedule.epochs} epochs, {schedule.theme}; {', '.join(rough) or 'quiet network'}"
    ]
    lines += [f"{role} starts {seconds:.3g} s late" for role, seconds in schedule.late.items()]
    return "\n".join(["", *(f"  {line}" for line in [*lines, *map(one_line, schedule.faults)])])


def one_line(fault: Fault) -> str:
    """A fault and what it is about."""
    own = {name: getattr(fault, name) for name in SIMPLE}
    more = [f"{name} {value:.3g}" for name, value in own.items() if value is not None and value != SIMPLE[name]]
    return f"at tick {fault.tick}: {fault.kind}{' (' + ', '.join(more) + ')' if more else ''}"
