"""Who drives, who drives next."""

import pytest
from phototaxis.wire.codec import Refused
from phototaxis_sim.seat import Seat


def test_a_free_seat_is_claimed_and_a_taken_one_is_not():
    seat = Seat()
    seat.claim("a", 0)
    seat.claim("a", 3)
    with pytest.raises(Refused, match="taken by a"):
        seat.claim("b", 4)
    with pytest.raises(Refused, match="b does not hold the seat"):
        seat.release("b", 4)
    assert seat.driver == "a"
    assert not seat.leave("b", 5)
    assert seat.leave("a", 5)
    assert seat.driver == ""
    with pytest.raises(Refused, match="names its agent"):
        seat.claim("", 6)


def test_takers_over_sit_down_at_their_tick_in_order():
    seat = Seat()
    seat.claim("a", 0)
    seat.reserve("c", 20)
    seat.reserve("b", 10)
    assert seat.waiting == ["b", "c"]
    assert not seat.boundary(9)
    assert seat.boundary(10)
    assert seat.driver == "b"
    assert not seat.boundary(11)
    assert seat.boundary(25)
    assert [(one.driver, one.tick, one.how) for one in seat.history] == [
        ("a", 0, "claimed"), ("b", 10, "took over"), ("c", 25, "took over"),
    ]  # fmt: skip


def test_standbys_sit_down_when_the_driver_vanishes():
    seat = Seat()
    seat.claim("a", 0)
    for agent in ("b", "c", "b"):
        seat.stand_by(agent, 1)
    assert seat.waiting == ["b", "c"]
    seat.leave("b", 2)
    assert seat.leave("a", 3)
    assert (seat.driver, seat.waiting) == ("c", [])
    assert seat.history[-1].how == "stood by"


def test_a_standby_takes_a_free_seat_unless_it_is_kept_for_its_former_driver():
    seat = Seat()
    seat.stand_by("b", 0)
    assert seat.driver == "b"
    kept = Seat(heir="a")
    kept.stand_by("b", 0)
    with pytest.raises(Refused, match="kept for a"):
        kept.claim("c", 0)
    assert kept.driver == ""
    kept.claim("a", 0)
    assert kept.waiting == []


def test_a_new_driver_has_no_standbys_until_they_ask_again():
    seat = Seat()
    seat.claim("a", 0)
    seat.stand_by("b", 1)
    seat.stand_by("c", 1)
    seat.leave("a", 2)
    assert (seat.driver, seat.waiting) == ("b", [])
    seat.stand_by("c", 2)
    assert seat.leave("b", 3)
    assert seat.driver == "c"


def test_an_early_taker_over_does_not_take_a_vanished_drivers_seat():
    seat = Seat()
    seat.claim("a", 0)
    seat.reserve("b", 100)
    seat.leave("a", 5)
    assert seat.driver == ""
    assert seat.next(100) == "b"
