"""The whole system on the simulated network: whatever a schedule does, the run is the one in one process."""

from simulated.faults import ACTS
from simulated.runs import results, run
from simulated.schedule import KINDS, make
from simulated.shrink import shrink, told
from simulated.timeline import Timeline

SEEDS = range(6700)
MIN_TICKS = 1_000_000


def test_every_schedule_ends_with_the_hashes_of_the_run_in_one_process():
    wrong, ticks = dict[int, str](), 0
    for seed, found in results(SEEDS):
        ticks += found.ticks
        if found.wrong:
            wrong[seed] = found.wrong
    simplest = [told(shrink(make(seed), lambda schedule: run(schedule).wrong)) for seed in list(wrong)[:3]]
    assert not wrong, f"{wrong}{''.join(simplest)}"
    assert ticks >= MIN_TICKS


def test_a_successor_inherits_although_a_question_is_lost():
    schedules = [make(seed) for seed in range(12)]
    for schedule in schedules:
        schedule.weather.query_loss = 0.3
    assert not any(run(schedule).wrong for schedule in schedules)


def test_a_seed_is_a_schedule():
    themes = {make(seed).theme: seed for seed in range(60)}
    assert themes.keys() == KINDS.keys()
    for seed in themes.values():
        assert make(seed) == make(seed)
        assert run(make(seed)) == run(make(seed))


def test_every_kind_of_fault_has_an_act():
    assert {kind.split()[0] for kinds in KINDS.values() for kind in kinds} == ACTS.keys()


def test_time_jumps_from_one_event_to_the_next_in_order():
    timeline, heard = Timeline(), []
    for name, when in (("late", 2.0), ("first", 1.0), ("second", 1.0)):
        timeline.at(when, heard.append, name)
    assert timeline.run(lambda: len(heard) == 3, 5.0)
    assert heard == ["first", "second", "late"]
    assert timeline.now == 2.0
    assert not timeline.run(lambda: False, 5.0)
