"""The seat's client: every transition of its table, and when it asks for what."""

from pathlib import Path
from typing import Any

import pytest
from making import readings
from phototaxis.runtime.machine import Ask, Effect, Say
from phototaxis.runtime.seat_client import ASK_EVERY_S, MATCH_WITHIN_S, RELEASE, TABLE, Mode, Place, SeatClient, Seen
from phototaxis.runtime.transitions import diagram
from phototaxis.wire.messages import ControlReply, Status

PAGE = Path(__file__).parents[2] / "ARCHITECTURE.md"
WAYS = {
    Place.SEEKING: [Seen.NAMED, Seen.FREE],
    Place.QUEUED: [Seen.NAMED, Seen.TAKEN],
    Place.SHADOWING: [Seen.TAKEN, Seen.APART],
    Place.IN_STEP: [Seen.TAKEN, Seen.EQUAL],
    Place.DRIVING: [Seen.NAMED],
    Place.SUPERSEDED: [Seen.NAMED, Seen.TAKEN, Seen.SUCCEEDED],
    Place.LEAVING: [Seen.LEFT],
}
"""How each place is reached."""
NAMES: dict[Seen, dict[str, Any]] = {
    Seen.NAMED: {"driver": "me"},
    Seen.FREE: {"driver": ""},
    Seen.TAKEN: {"driver": "other"},
    Seen.SUCCEEDED: {"driver": "other", "author": "other"},
}


def give(client: SeatClient, seen: Seen) -> list[Effect]:
    """Let a client learn something by its public methods."""
    if seen in NAMES:
        return client.see(readings(**NAMES[seen]), 0.0)
    if seen is Seen.LEFT:
        return client.leave()
    if seen is Seen.WANTED:
        return client.want("claim", 0.0)
    if seen is Seen.RUN:
        client.enter()
    elif seen is Seen.APART or seen is Seen.EQUAL or seen is Seen.GAP:
        client.learn(seen)
    return []


@pytest.mark.parametrize(("row", "after"), TABLE.items(), ids=lambda one: "/".join(one) if type(one) is tuple else one)
def test_every_transition_is_taken(row, after):
    before, seen = row
    client = SeatClient("me")
    for one in WAYS[before]:
        give(client, one)
    assert client.place is before
    give(client, seen)
    assert client.place is after
    print(f"{before} + {seen} → {after}")


def test_the_documented_transitions_are_the_real_ones():
    assert diagram(TABLE) in PAGE.read_text()


def requests(effects: list[Effect]) -> list[Any]:
    """What the simulation is asked."""
    return [one.request for one in effects if isinstance(one, Ask)]


def asked(effects: list[Effect]) -> list[str]:
    """The verbs that are asked."""
    return [one.verb for one in requests(effects)]


def said(effects: list[Effect]) -> str:
    return " ".join(one.text for one in effects if isinstance(one, Say))


def reply(ok: bool) -> ControlReply:
    return ControlReply(ok=ok, reason="" if ok else "no", status=Status(run="r", phase="running", driver="a", tick=7))


def test_a_free_seat_is_claimed_again_until_it_is_ours_and_one_question_is_out_at_a_time():
    client = SeatClient("me")
    assert asked(client.see(readings(), 0.0)) == ["claim"]
    assert asked(client.see(readings(), 1.0)) == []
    assert client.answered(reply(False)) == []
    assert asked(client.see(readings(), ASK_EVERY_S / 2)) == []
    assert asked(client.see(readings(), ASK_EVERY_S)) == ["claim"]
    client.answered(None)
    assert asked(client.see(readings(), 2 * ASK_EVERY_S)) == ["claim"]
    client.answered(reply(True))
    assert client.place is Place.SEEKING, "readings say who drives"
    assert client.see(readings(driver="me"), 9.0) == []
    assert client.place is Place.DRIVING


def test_who_claims_waits_for_a_driver_and_says_so_once():
    client = SeatClient("me")
    assert "waits until a leaves the seat" in said(client.see(readings(driver="a"), 0.0))
    assert client.see(readings(driver="a"), 1.0) == []
    assert asked(client.see(readings(), 2.0)) == ["claim"]


@pytest.mark.parametrize(("mode", "line"), [("take over", "takes over from tick 5 on"), ("stand by", "stands by")])
def test_a_simulation_that_is_back_is_asked_anew(mode: Mode, line):
    client = SeatClient("me", mode, at=5)
    client.see(readings(driver="a", author="a"), -1.0)
    if mode == "stand by":
        client.learn(Seen.EQUAL)
    else:
        client.answered(None)
    for now in (0.0, 1.0):
        (request,) = requests(client.see(readings(driver="a"), now))
        assert (request.verb, request.agent, request.at) == (mode, "me", 5)
        assert said(client.answered(reply(True))) == f"{line}; a drives at tick 7"
        assert client.see(readings(driver="a"), now + 0.9) == []
        client.simulation_is_back()


def test_who_has_taken_over_once_claims_from_then_on_and_leaves_for_a_successor():
    client = SeatClient("me", "take over")
    client.see(readings(driver="a"), 0.0)
    client.see(readings(driver="me"), 1.0)
    client.answered(reply(True))  # the readings were faster
    assert client.mode == "claim"
    assert "unseated at tick 3: b drives" in said(client.see(readings(3, driver="b", author="me"), 2.0))
    assert client.place is Place.QUEUED
    client.see(readings(4, driver="b", author="b"), 3.0)
    assert client.place is Place.SUPERSEDED


def driven(tick: int) -> SeatClient:
    """A client that was named at a tick, and then sees that nobody drives."""
    client = SeatClient("me", "take over")
    client.see(readings(tick, driver="me", author="former"), 0.0)
    client.see(readings(tick, driver="", author="former"), 0.1)
    assert client.place is Place.SEEKING
    return client


def test_who_is_succeeded_learns_it_although_its_successor_is_gone_again():
    client = driven(5)
    assert asked(client.see(readings(6, driver="", author="successor"), 1.0)) == []
    assert client.place is Place.SUPERSEDED


def test_a_predecessor_is_no_successor_when_the_simulation_comes_back_to_the_same_tick():
    client = driven(5)
    client.answered(None)
    assert asked(client.see(readings(5, driver="", author="former"), 1.0)) == ["claim"]
    assert client.place is Place.SEEKING


def test_readings_that_were_overtaken_say_nothing():
    client = SeatClient("me")
    client.see(readings(4, driver="a"), 0.0)
    client.see(readings(5, driver="a"), 0.0)
    client.see(readings(5, driver="me"), 0.0)
    for late in (readings(4, driver="a"), readings(4, driver=""), readings(5, driver="a", author="a")):
        assert client.stale(late)
        assert client.see(late, 1.0) == []
        assert client.place is Place.DRIVING
    client.see(readings(5, driver="b"), 2.0)
    assert client.place is Place.QUEUED, "another one was seated in the same tick"
    client.see(readings(5, driver="me"), 3.0)
    assert client.place is Place.DRIVING, "who is named itself believes it"
    client.see(readings(5, driver=""), 4.0)
    assert client.place is Place.SEEKING
    client.see(readings(6, driver="a"), 4.0)
    assert client.place is Place.QUEUED, "in a later tick anybody may drive"
    client.see(readings(2, driver="me", run="s"), 5.0)
    assert client.place is Place.DRIVING, "another run has ticks of its own"


def test_a_simulation_that_is_back_may_seat_anybody_in_the_same_tick():
    client = SeatClient("me")
    client.see(readings(5, driver="a"), 0.0)
    client.see(readings(5, driver="b"), 0.0)
    client.simulation_is_back()
    assert not client.stale(readings(5, driver="a"))


def test_a_standby_that_lost_the_seat_waits_to_be_the_drivers_equal_again():
    client = SeatClient("me", "stand by")
    client.see(readings(driver="me"), 0.0)
    assert asked(client.see(readings(1, driver="b", author="me"), 1.0)) == []
    client.see(readings(2, driver="b", author="b"), 2.0)
    assert client.place is Place.QUEUED
    client.learn(Seen.EQUAL)
    assert asked(client.see(readings(3, driver="b", author="b"), 3.0)) == ["stand by"]


@pytest.mark.parametrize(("seen", "for_good"), [(Seen.EQUAL, False), (Seen.APART, True)])
def test_a_standby_queues_once_it_knows_what_the_driver_knows_or_that_it_never_will(seen, for_good):
    client = SeatClient("me", "stand by")
    for now in (0.0, 1.0):
        assert client.see(readings(driver="a", author="a"), now) == [], "a seat it is given now is a state that is lost"
    client.learn(seen, for_good)
    assert asked(client.see(readings(1, driver="a", author="a"), 2.0)) == ["stand by"]


@pytest.mark.parametrize(("driver", "author"), [("a", "a"), ("a", "b"), ("a", ""), ("", "a")])
def test_a_standby_that_cannot_match_a_driver_in_time_takes_the_seat_as_it_is(driver, author):
    client = SeatClient("me", "stand by")
    client.see(readings(1, driver=driver, author=author), 0.0)
    assert client.see(readings(1, driver=driver, author=author), MATCH_WITHIN_S - 0.1) == []
    late = client.see(readings(1, driver=driver, author=author), MATCH_WITHIN_S)
    assert asked(late) == ["stand by" if driver else "claim"]


def test_a_standby_is_apart_from_one_driver_and_not_from_the_next():
    client = SeatClient("me", "stand by")
    client.see(readings(1, driver="a", author="a"), 0.0)
    client.learn(Seen.APART, for_good=True)
    client.see(readings(2, driver="a", author="a"), 1.0)
    client.answered(reply(True))
    assert client.see(readings(3, driver="b", author="a"), 2.0) == []
    client.learn(Seen.EQUAL)
    assert asked(client.see(readings(4, driver="b", author="b"), 3.0)) == ["stand by"], "the queue is the new driver's"


def test_a_standby_claims_a_seat_that_nobody_has_had():
    assert asked(SeatClient("me", "stand by").see(readings(), 0.0)) == ["claim"]


def test_in_another_run_it_is_no_successors_predecessor():
    client = SeatClient("me")
    client.see(readings(driver="me"), 0.0)
    client.enter()
    client.see(readings(driver="b", author="b"), 1.0)
    assert client.place is Place.QUEUED


def test_an_answer_that_names_us_counts_before_any_readings():
    client = SeatClient("me")
    assert asked(client.want("take over", 0.0)) == ["take over"]
    client.answered(reply(True))
    client.seated()
    assert client.place is Place.DRIVING
    assert asked(client.see(readings(), 0.1)) == []
    assert asked(client.see(readings(), ASK_EVERY_S)) == ["claim"], "a simulation that is back has nobody in the seat"


def test_who_leaves_gives_the_seat_back():
    client = SeatClient("me")
    effects = client.leave()
    (request,) = requests(effects)
    assert (request.verb, request.agent) == ("release", "me")
    assert [one.tag for one in effects if isinstance(one, Ask)] == [RELEASE]
