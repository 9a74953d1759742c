"""The recorder's machine: each chunk once and in its order, whatever is dropped, late, or written by another."""

import math
import random
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from phototaxis.runtime.machine import START, STOP, TIME, Answer, Ask, Effect, Event, Stop
from phototaxis.runtime.transitions import diagram
from phototaxis.wire.messages import LogRequest, SimLog, World
from phototaxis_recorder.gathering import (
    ASK_EVERY_S,
    BEHIND_TICKS,
    KEEP_EVERY_S,
    LOGS,
    TABLE,
    Close,
    Gathering,
    Keep,
    Note,
    Open,
    Report,
)
from phototaxis_recorder.reader import Write
from phototaxis_sim import arenas
from transitions import assert_all_taken

PAPER = arenas.load("paper")
SIM = Event("alive", ("sim", "sim"))
NO_WORLD = Event("answer", Answer("world", []))
TICKS = 4
"""Of a chunk."""


def log(seq: int, writer: str = "sim", run: str = "r", first: int | None = None) -> SimLog:
    """A chunk; chunk n of a writer has the ticks from 4n on, unless `first` says otherwise."""
    first = TICKS * seq if first is None else first
    ticks = list(range(first, first + TICKS))
    some, none = [1.0] * TICKS, [0] * TICKS
    return SimLog(
        run=run, seq=seq, writer=writer, driver="", tick=ticks, episode=none, time=some, x=some, y=some,
        heading=some, left=some, right=some, contact=none, ended=[],
    )  # fmt: skip


def came(seq: int, writer: str = "sim", run: str = "r", first: int | None = None, topic: str = "log/sim") -> Event:
    return Event(topic, log(seq, writer, run, first))


def world(run: str = "r") -> Event:
    return Event("answer", Answer("world", [World(run=run, arena=PAPER, seed=3, epochs=0)]))


def answer(asked: Effect, *chunks: SimLog) -> Event:
    assert isinstance(asked, Ask)
    return Event("answer", Answer(asked.tag, chunks))


class Play:
    """A machine in its time, and what it has written: (topic, writer, number) of each chunk."""

    def __init__(self, now: float = 100.0):
        self.machine, self.now, self.written = Gathering(), now, list[tuple[str, str, int]]()
        self.tell(START)

    def tell(self, *events: Event, after: float = 0.0) -> list[Effect]:
        """What follows from the last of several events, but for what is written."""
        self.now += after
        effects: list[Effect] = []
        for event in events:
            effects = self.machine.on(event, self.now)
            writes = [effect for effect in effects if isinstance(effect, Write)]
            self.written += [(write.topic, write.chunk.writer, write.chunk.seq) for write in writes]
        return [effect for effect in effects if not isinstance(effect, Write)]

    def numbers(self, topic: str = "log/sim") -> list[int]:
        return [seq for where, _, seq in self.written if where == topic]


def questions(effects: Sequence[Effect]) -> list[Ask]:
    return [effect for effect in effects if isinstance(effect, Ask)]


def recording() -> Play:
    """The run "r" is recorded, all three topics have been asked, and nobody had anything."""
    play = Play()
    play.tell(SIM, Event("alive", ("agent", "a")), Event("alive", ("agent", "b")))
    for asked in questions(play.tell(world())):
        assert play.tell(answer(asked)) == []
    return play


def test_a_simulation_brings_a_run_which_is_asked_for_all_it_has():
    play = Play()
    assert play.machine.deadline == math.inf
    assert play.tell(SIM) == [Ask("world", "world")]
    effects = play.tell(world())
    opened, report, *asked = effects
    assert isinstance(opened, Open)
    assert opened.world.run == "r"
    assert report == Report()
    assert [(one.topic, one.request, one.every) for one in questions(asked)] == [
        (topic, LogRequest(seq=0, writer=""), True) for topic in LOGS
    ]
    assert len({one.tag for one in questions(asked)}) == len(LOGS)


def test_chunks_are_written_once_and_in_order():
    play = recording()
    for seq in (0, 1, 1, 0, 2):
        assert play.tell(came(seq)) == []
    assert play.numbers() == [0, 1, 2]


def test_what_follows_a_gap_waits_until_the_gap_was_asked_for():
    play = recording()
    (asked,) = questions(play.tell(came(0), came(3)))
    assert (asked.topic, asked.request) == ("log/sim", LogRequest(seq=1, writer="sim"))
    assert play.tell(came(4)) == []
    assert play.numbers() == [0]
    play.tell(answer(asked, log(1), log(2), log(3)))
    assert play.numbers() == [0, 1, 2, 3, 4]


def test_what_nobody_has_any_more_is_left_out():
    play = recording()
    (asked,) = questions(play.tell(came(0), came(3)))
    play.tell(came(4))
    assert play.tell(answer(asked)) == []
    assert play.numbers() == [0, 3, 4]


def test_an_answer_says_nothing_of_a_chunk_that_was_published_after_the_question():
    play = Play()
    everybody = {asked.topic: asked for asked in questions(play.tell(SIM, world()))}
    play.tell(came(1))
    (asked,) = questions(play.tell(answer(everybody["log/sim"])))
    assert asked.request == LogRequest(seq=0, writer="sim")
    play.tell(answer(asked, log(0), log(1)))
    assert play.numbers() == [0, 1]


def test_a_second_gap_behind_the_first_is_asked_for_too():
    play = recording()
    (first,) = questions(play.tell(came(2)))
    play.tell(came(5))
    (second,) = questions(play.tell(answer(first)))
    assert second.request == LogRequest(seq=3, writer="sim")
    play.tell(answer(second, log(3), log(4), log(5)))
    assert play.numbers() == [2, 3, 4, 5]


def test_a_gap_of_a_writer_that_is_gone_is_not_asked_for():
    play = recording()
    assert play.tell(came(0), Event("gone", ("sim", "sim")), came(3)) == []
    assert play.numbers() == [0, 3]


def test_before_a_successors_chunks_come_the_last_of_its_predecessor():
    play, agent = recording(), "log/agent"
    (asked,) = questions(play.tell(came(0, "a", topic=agent), came(0, "b", first=8, topic=agent)))
    assert asked.request == LogRequest(seq=1, writer="a")
    play.tell(answer(asked, log(1, "a")))
    assert play.written == [(agent, "a", 0), (agent, "a", 1), (agent, "b", 0)]


def test_a_successor_whose_first_chunks_are_missing_is_asked_after_its_predecessor():
    play, agent = recording(), "log/agent"
    (first,) = questions(play.tell(came(0, "a", topic=agent), came(2, "b", first=16, topic=agent)))
    (second,) = questions(play.tell(answer(first, log(1, "a"))))
    assert second.request == LogRequest(seq=0, writer="b")
    play.tell(answer(second, log(0, "b", first=8), log(1, "b", first=12), log(2, "b", first=16)))
    assert play.written == [(agent, *which) for which in (("a", 0), ("a", 1), ("b", 0), ("b", 1), ("b", 2))]


def test_a_restarted_writer_follows_one_that_is_gone():
    play, agent = recording(), "log/agent"
    play.tell(came(0, "a", topic=agent), Event("gone", ("agent", "a")))
    assert play.tell(came(0, "b", first=4, topic=agent)) == []
    assert play.written == [(agent, "a", 0), (agent, "b", 0)]


def test_a_restarted_writer_whose_first_chunks_are_missing_is_asked_for_them():
    play, agent = recording(), "log/agent"
    play.tell(came(0, "a", topic=agent), Event("gone", ("agent", "a")))
    (asked,) = questions(play.tell(came(1, "b", first=8, topic=agent)))
    assert asked.request == LogRequest(seq=0, writer="b")
    play.tell(answer(asked, log(0, "b", first=4), log(1, "b", first=8)))
    assert play.written == [(agent, "a", 0), (agent, "b", 0), (agent, "b", 1)]


def test_a_late_recorder_takes_the_chunks_of_several_writers_by_their_ticks():
    play = Play()
    asked = questions(play.tell(SIM, Event("alive", ("agent", "b")), world()))
    agents = next(one for one in asked if one.topic == "log/agent")
    assert play.tell(came(1, "b", first=12, topic="log/agent")) == []
    play.tell(answer(agents, log(0, "b", first=8), log(0, "a", first=0), log(1, "a", first=4)))
    assert [which[1:] for which in play.written] == [("a", 0), ("a", 1), ("b", 0), ("b", 1)]


def test_a_silent_topic_is_asked_once_a_second():
    play = recording()
    play.tell(came(0), after=0.9 * ASK_EVERY_S)
    report, *asked = [one for one in play.tell(TIME, after=0.1 * ASK_EVERY_S) if one != Keep()]
    assert report == Report()
    assert [one.topic for one in questions(asked)] == ["log/sensors", "log/agent"]
    assert questions(play.tell(TIME, after=0.5 * ASK_EVERY_S)) == []
    assert [one.topic for one in questions(play.tell(TIME, after=0.5 * ASK_EVERY_S))] == ["log/sim"], "others are asked"
    assert questions(play.tell(answer(asked[0]), TIME)) == []
    again = questions(play.tell(TIME, after=ASK_EVERY_S))
    assert [one.topic for one in again] == ["log/sensors"]


def test_a_topic_that_lags_is_asked_although_it_is_not_silent():
    play = recording()
    play.tell(came(0), came(0, topic="log/sensors"), came(0, "a", topic="log/agent"), after=0.5 * ASK_EVERY_S)
    for seq in range(1, BEHIND_TICKS // TICKS + 2):
        play.tell(came(seq), came(seq, topic="log/sensors"))
    (asked,) = questions(play.tell(TIME, after=0.5 * ASK_EVERY_S))
    assert (asked.topic, asked.request) == ("log/agent", LogRequest(seq=1, writer="a"))


def test_the_recording_is_brought_to_disk_at_its_times():
    play = recording()
    assert play.machine.deadline == play.now + KEEP_EVERY_S
    assert play.tell(TIME, after=0.9 * KEEP_EVERY_S) == []
    assert play.tell(TIME, after=0.1 * KEEP_EVERY_S) == [Keep()]
    assert play.tell(came(0), after=KEEP_EVERY_S) == [Keep()], "without an idle moment too"


def test_another_run_is_another_recording():
    play = recording()
    play.tell(came(0))
    assert play.tell(came(1, run="s")) == [Ask("world", "world")]
    assert play.tell(came(1)) == [], "the run that is recorded goes on meanwhile"
    rest = questions(play.tell(world("s")))
    assert [one.topic for one in rest] == list(LOGS), "what is left of it comes first"
    assert play.tell(came(2, run="s"), answer(rest[0], log(2), log(3, run="s")), answer(rest[1])) == []
    closed, opened = play.tell(answer(rest[2]))
    assert closed == Close()
    assert isinstance(opened, Open)
    assert opened.world.run == "s"
    assert play.numbers() == [0, 1, 2]
    assert play.machine.deadline == play.now
    sim, *_ = questions(play.tell(TIME))
    play.tell(answer(sim, log(2), log(3, run="s")))
    assert play.written[-1] == ("log/sim", "sim", 3)


def completing() -> tuple[Play, list[Ask]]:
    """The run "r" is recorded, another one is known, and what is left of "r" is asked for."""
    play = recording()
    play.tell(came(0), came(0, run="s"))
    return play, questions(play.tell(world("s")))


def test_the_next_run_waits_for_the_open_questions_about_the_present_one():
    play = recording()
    (gap,) = questions(play.tell(came(3)))
    play.tell(came(0, run="s"))
    rest = questions(play.tell(world("s")))
    assert play.tell(came(1, run="t"), world("t"), *map(answer, rest)) == [], "one run at a time"
    closed, opened = play.tell(answer(gap, log(0), log(1), log(2)))
    assert closed == Close()
    assert isinstance(opened, Open)
    assert opened.world.run == "s"
    assert play.numbers() == [0, 1, 2, 3]


def test_a_recorder_that_stops_completes_the_run_that_it_records():
    play, rest = completing()
    asked = questions(play.tell(STOP))
    assert [one.topic for one in asked] == list(LOGS)
    assert play.tell(*map(answer, [*rest, *asked])) == [Close(), Stop()]


def test_a_stray_chunk_of_another_run_changes_nothing():
    play = recording()
    assert play.tell(came(0), came(5, run="stray")) == [Ask("world", "world")]
    assert play.tell(world(), came(1)) == []
    assert play.tell(came(6, run="stray"), NO_WORLD, came(2)) == []
    assert play.numbers() == [0, 1, 2]


def test_without_a_world_a_simulation_is_asked_again_after_a_second():
    play = Play()
    play.tell(SIM)
    assert play.tell(came(0)) == [], "one question at a time"
    assert play.tell(NO_WORLD) == []
    assert play.machine.deadline == play.now + ASK_EVERY_S
    assert play.tell(TIME, after=ASK_EVERY_S) == [Ask("world", "world")]
    assert play.machine.deadline == math.inf
    play.tell(NO_WORLD, Event("gone", ("sim", "sim")))
    assert play.machine.deadline == math.inf
    assert play.tell(TIME, after=ASK_EVERY_S) == []


def test_who_comes_and_goes_is_noted():
    play = recording()
    assert play.tell(Event("alive", ("agent", "c"))) == [Note(text="c is here")]
    assert play.tell(Event("gone", ("agent", "c"))) == [Note(text="c is gone")]
    assert play.tell(Event("alive", ("observer", "me"))) == []
    note, ask = play.tell(Event("alive", ("sim", "sim-2")))
    assert (note, ask) == (Note(text="sim-2 is here"), Ask("world", "world"))


def test_at_its_end_it_asks_once_more_and_closes():
    play = recording()
    play.tell(came(0), came(0, "a", topic="log/agent"))
    asked = questions(play.tell(STOP))
    assert [(one.topic, one.request) for one in asked] == [
        ("log/sim", LogRequest(seq=1, writer="sim")),
        ("log/sensors", LogRequest(seq=0, writer="")),
        ("log/agent", LogRequest(seq=1, writer="a")),
    ]
    assert play.tell(STOP) == []
    assert play.tell(Event("alive", ("sim", "late"))) == [Note(text="late is here")]
    assert play.tell(answer(asked[0], log(1), log(2)), answer(asked[1])) == []
    assert play.tell(answer(asked[2])) == [Close(), Stop()]
    assert play.numbers() == [0, 1, 2]


def test_a_gap_that_is_open_at_the_end_is_still_filled():
    play = recording()
    (gap,) = questions(play.tell(came(2)))
    asked = questions(play.tell(STOP))
    for one in asked:
        assert play.tell(answer(one, *([log(3)] if one.topic == "log/sim" else []))) == []
    assert play.tell(answer(gap, log(0), log(1), log(2))) == [Close(), Stop()]
    assert play.numbers() == [0, 1, 2, 3]


def test_without_a_run_it_stops_at_once():
    assert Play().tell(STOP) == [Stop()]


@pytest.mark.parametrize("found", [world("r"), world("s"), NO_WORLD])
def test_a_world_that_is_asked_for_is_waited_for_at_the_end(found: Event):
    play = recording()
    assert play.tell(came(0, run="s"), came(1, run="s"), STOP, STOP) == []
    assert play.tell(came(0, run="s")) == []
    effects = play.tell(found)
    assert [one.topic for one in questions(effects)] == list(LOGS)
    answers = [answer(asked) for asked in questions(effects)]
    assert play.tell(*answers) == [Close(), Stop()]


def test_a_first_world_that_comes_at_the_end_is_recorded():
    play = Play()
    play.tell(SIM, STOP)
    opened, *asked = [one for one in play.tell(world()) if one != Report()]
    assert isinstance(opened, Open)
    answers = [answer(one, *([log(0)] if one.topic == "log/sim" else [])) for one in questions(asked)]
    assert play.tell(*answers) == [Close(), Stop()]
    assert play.numbers() == [0]
    play = Play()
    play.tell(SIM, STOP)
    assert play.tell(NO_WORLD) == [Stop()]


@pytest.mark.parametrize("seed", range(30))
def test_every_chunk_is_written_once_and_in_order_whatever_is_lost(seed: int):
    """Chunks are lost, doubled and late; questions are answered late, from all that was published until then."""
    draw, play, published = random.Random(seed), recording(), list[SimLog]()
    open_questions: list[Ask] = []

    def tell(event: Event) -> list[Effect]:
        effects = play.tell(event, after=0.02)
        open_questions.extend(questions(effects))
        return effects

    def reply(asked: Ask) -> list[Effect]:
        request: Any = asked.request
        has = [chunk for chunk in published if chunk.seq >= request.seq] if asked.topic == "log/sim" else []
        return tell(answer(asked, *has))

    for seq in range(300):
        published.append(log(seq))
        late = published[-draw.choice([1, 1, 1, 1, 2, 5]) :][0]
        for _ in range(draw.choice([0, 1, 1, 1, 1, 2])):
            tell(Event("log/sim", late))
        while open_questions and draw.random() < 0.4:
            reply(open_questions.pop(draw.randrange(len(open_questions))))
    last = tell(STOP)
    while open_questions:
        last = reply(open_questions.pop(0))
    assert last[-2:] == [Close(), Stop()]
    assert play.numbers() == list(range(300))


@pytest.mark.parametrize("seed", range(30))
def test_whatever_happens_it_records_one_run_at_a_time_never_spins_and_ends(seed: int):
    draw, play, opened = random.Random(seed), Play(), list[str]()
    asked: list[Ask] = []

    def tell(event: Event, after: float) -> list[Effect]:
        effects = play.tell(event, after=after)
        asked.extend(questions(effects))
        for effect in effects:
            if isinstance(effect, Open):
                opened.append(effect.world.run)
            elif isinstance(effect, Close):
                opened.append("closed")
        return effects

    def reply() -> list[Effect]:
        one = asked.pop(draw.randrange(len(asked)))
        if one.topic == "world":
            return tell(draw.choice([NO_WORLD, world("r"), world("s")]), 0.01)
        return tell(answer(one, *[log(seq, run=draw.choice("rs")) for seq in range(draw.randrange(4))]), 0.01)

    for _ in range(300):
        who = draw.choice([("sim", "sim"), ("agent", "a"), ("agent", "b")])
        chunk = came(draw.randrange(20), draw.choice(["sim", "a", "b"]), draw.choice("rrrs"), topic=draw.choice(LOGS))
        tell(draw.choice([TIME, Event("alive", who), Event("gone", who), chunk, chunk]), draw.choice([0.0, 0.01, 0.5]))
        if asked and draw.random() < 0.5:
            reply()
        wait = max(play.machine.deadline - play.now, 0.0)
        tell(TIME, wait if wait < math.inf else 0.0)
        assert play.machine.deadline > play.now
    last = tell(STOP, 0.0)
    while asked and Stop() not in last:
        last = reply()
    assert last[-1] == Stop()
    assert opened[1::2] == ["closed"] * (len(opened) // 2)
    assert "closed" not in opened[::2]


def test_every_transition_is_taken():
    scenarios = [
        test_without_a_world_a_simulation_is_asked_again_after_a_second,
        test_another_run_is_another_recording,
        test_a_stray_chunk_of_another_run_changes_nothing,
        test_the_next_run_waits_for_the_open_questions_about_the_present_one,
        test_a_recorder_that_stops_completes_the_run_that_it_records,
        test_at_its_end_it_asks_once_more_and_closes,
        test_without_a_run_it_stops_at_once,
        test_a_first_world_that_comes_at_the_end_is_recorded,
        *(partial(test_a_world_that_is_asked_for_is_waited_for_at_the_end, found) for found in (world("s"), NO_WORLD)),
    ]
    assert_all_taken(TABLE, scenarios)


def test_the_documented_diagram_is_the_table():
    assert diagram(TABLE) in (Path(__file__).parents[2] / "ARCHITECTURE.md").read_text()
