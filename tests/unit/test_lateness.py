"""Which ticks had no command in time, and who is named for it."""

from phototaxis_sim.lateness import MIN_LATE_TICKS, RECENT_TICKS, Lateness


def test_late_ticks_are_counted_and_the_slower_part_is_named_when_it_matters():
    lateness = Lateness()
    for _ in range(MIN_LATE_TICKS - 1):
        lateness.late(sensed=True)
        lateness.in_time()
    assert lateness.told("q-1", "sensors-1") == ""
    lateness.late(sensed=True)
    assert lateness.told("q-1", "sensors-1").startswith(
        f"q-1 is too slow: {MIN_LATE_TICKS} of the last {2 * MIN_LATE_TICKS - 1} ticks had"
    )
    for _ in range(MIN_LATE_TICKS + 1):
        lateness.late(sensed=False)
    assert lateness.told("q-1", "sensors-1").startswith("sensors-1 is too slow")
    assert (lateness.ticks, lateness.unsensed) == (2 * MIN_LATE_TICKS + 1, MIN_LATE_TICKS + 1)


def test_what_is_over_is_told_no_more_but_stays_counted():
    lateness = Lateness()
    for _ in range(MIN_LATE_TICKS):
        lateness.late(sensed=True)
    for _ in range(RECENT_TICKS):
        lateness.in_time()
    assert lateness.told("q-1", "sensors-1") == ""
    assert lateness.ticks == MIN_LATE_TICKS
