"""The step protocol's small pieces: answers, questions, pace, and the journal."""

from pathlib import Path

from making import readings
from phototaxis.runtime.journal import Journal
from phototaxis.runtime.protocol import AnswerCache, RetransmitTimer
from phototaxis_sim.pace import Pace


def test_once_answers_a_tick_once_and_repeats_the_answer():
    asked = []
    once = AnswerCache(lambda question: asked.append(question.tick) or f"answer {question.tick}")
    assert [once(readings(tick)) for tick in (0, 0, 1, 0, 1, 2)] == [
        "answer 0", "answer 0", "answer 1", None, "answer 1", "answer 2",
    ]  # fmt: skip
    assert asked == [0, 1, 2]


def test_once_begins_anew_with_another_run():
    once = AnswerCache(lambda question: question.run)
    assert once(readings(5, run="a")) == "a"
    assert once(readings(0, run="b")) == "b"


def test_a_question_is_repeated_with_growing_pauses():
    question = RetransmitTimer(first=1, most=4)
    question.asked(0)
    assert [now for now in range(20) if question.due(now)] == [1, 3, 7, 11, 15, 19]
    question.asked(20)
    assert not question.due(20.5)
    assert question.due(21)


def test_in_real_time_a_command_holds_for_two_periods():
    pace = Pace(period=0.5, speed=2)
    pace.set(2, now=10)
    assert pace.wait(10) == 0.25
    pace.commanded(10)
    assert not pace.stale(10.5)
    assert pace.stale(10.6)
    pace.begun(10.25)
    assert pace.wait(10.25) == 0.25


def test_a_journal_survives_a_torn_end(tmp_path: Path):
    path = tmp_path / "j"
    journal = Journal(path)
    assert journal.read() == []
    journal.begin(b"head")
    for entry in (b"one", b"two", b"three"):
        journal.append(entry)
    journal.close()
    assert Journal(path).read() == [b"head", b"one", b"two", b"three"]
    path.write_bytes(path.read_bytes()[:-2])
    assert Journal(path).read() == [b"head", b"one", b"two"]
    data = bytearray(path.read_bytes())
    data[14] ^= 1
    path.write_bytes(bytes(data))
    assert Journal(path).read() == [b"head"]
    journal.begin(b"new")
    assert journal.read() == [b"new"]
