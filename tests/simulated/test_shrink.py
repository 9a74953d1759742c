"""A schedule that fails is made simple, and a run can be read line by line."""

from msgspec.structs import replace

from simulated.mutations import MUTATIONS
from simulated.runs import run
from simulated.schedule import make
from simulated.shrink import ddmin, shrink, told
from simulated.trace import Trace


def test_what_a_failure_does_not_need_is_left_out():
    assert ddmin(list(range(50)), lambda items: {3, 11, 40} <= {*items}) == [3, 11, 40]
    assert ddmin([1, 2, 3], lambda items: True) == []
    assert ddmin([7], lambda items: 7 in items) == [7]


def test_the_schedule_that_finds_a_defect_has_no_fault_too_many(monkeypatch):
    mutation = next(one for one in MUTATIONS if one.about == "keeps no journal of the commands")
    monkeypatch.setattr(mutation.where, mutation.name, mutation.make(getattr(mutation.where, mutation.name)))
    schedule = next(make(seed) for seed in range(50) if run(make(seed)).wrong.startswith("Broken"))
    simplest = shrink(schedule, lambda schedule: run(schedule).wrong)
    assert run(simplest).wrong
    assert any("sim" in fault.kind for fault in simplest.faults)
    for fault in simplest.faults:
        assert not run(replace(simplest, faults=[one for one in simplest.faults if one is not fault])).wrong
    assert "quiet network" in told(simplest)


def test_a_trace_tells_faults_changes_and_how_many_turns_were_quiet():
    lines: list[str] = []
    with Trace(lines.append).watching():
        found = run(make(5))
    assert not found.wrong
    assert any("=== at tick" in line for line in lines)
    assert any("agent-1" in line and "seeking → driving" in line and "command 0" in line for line in lines)
    assert any("quiet turns, to tick" in line for line in lines)
    assert len(lines) < 3 * found.ticks


def test_a_trace_and_a_count_change_nothing():
    with Trace(lambda _: None).watching():
        traced = run(make(5))
    counted = run(make(5), covered=True)
    assert traced.faults == counted.faults == run(make(5)).faults
    assert counted.taken["sim", "waiting", "somebody drives"] > 0
