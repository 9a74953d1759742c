"""The agent's machine without a bus: joins, answers once, follows, inherits, keeps itself, leaves."""

import math
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import decode, encode, learner_hash
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.journal import GIVEN_UP, Journal
from phototaxis.runtime.machine import (
    STOP,
    TIME,
    Answer,
    Append,
    Ask,
    Begin,
    Effect,
    Event,
    Flush,
    Publish,
    Record,
    Refuse,
    Reply,
    Save,
    Say,
    Stop,
    Unwritten,
    Warn,
)
from phototaxis.runtime.seat_client import Place
from phototaxis.runtime.store import Store
from phototaxis.wire.columns import COUNT, FLAG, pack
from phototaxis.wire.messages import (
    BatchReadings,
    CheckpointReply,
    CheckpointRequest,
    Command,
    ControlReply,
    Readings,
    Status,
    World,
)
from phototaxis_agent import kept
from phototaxis_agent.client import AgentClient
from phototaxis_agent.following import ASK_AGAIN_S, INHERIT_WITHIN_S
from phototaxis_agent.keeping import SAVE_EVERY_S, Kept
from phototaxis_agent.rows import AgentLogs
from phototaxis_agent.setup import AgentSetup, make_setup
from phototaxis_lab.loop import Loop
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim.simulation import Simulation

TICKS = 150


class Desk:
    """An agent's machine with everything that its effects reach: what it publishes, asks, says and writes."""

    def __init__(self, world: World, setup: AgentSetup | None = None, ident: str = "a", **options):
        self.world, self.now = world, 0.0
        agent = (setup or make_setup()).agent
        self.machine = AgentClient(ident, lambda world: agent(world), **options)
        self.effects: list[Effect] = []
        self.asked: list[Any] = []
        self.full: set[type] = set()
        """Kinds of effects that the disk does not take."""
        self.journal: list[bytes] | None = None
        self.saved = b""

    def give(self, event: Event) -> list[Effect]:
        """One event; what followed, and what followed from a full disk."""
        since = len(self.effects)
        for effect in self.machine.on(event, self.now):
            self._carry(effect)
        return self.effects[since:]

    def read(self, readings: Readings, **changes) -> list[Effect]:
        """Readings; where a run's world is asked for it is answered at once."""
        since = len(self.effects)
        self.give(Event("readings", msgspec.structs.replace(readings, **changes)))
        if self.asked and self.asked[-1].topic == "world":
            self.answer(self.world)
        return self.effects[since:]

    def answer(self, *messages: object) -> list[Effect]:
        """Answer the newest question."""
        return self.give(Event("answer", Answer(self.asked.pop().tag, messages)))

    def commands(self) -> list[Command]:
        return [one.message for one in self.effects if isinstance(one, Publish) and isinstance(one.message, Command)]

    def said(self) -> str:
        return "\n".join(one.text for one in self.effects if isinstance(one, (Say, Warn)))

    def checkpoint(self) -> bytes:
        """What it would tell a successor of its kind."""
        agent = self.machine.agent
        assert agent is not None
        return encode(*agent.checkpoint())

    def _carry(self, effect: Effect) -> None:
        self.effects.append(effect)
        if isinstance(effect, Ask):
            self.asked.append(effect)
        if isinstance(effect, (Save, Begin, Append)) and (failed := self._write(effect)):
            self.journal = None if failed == "journal" else self.journal
            self.give(Event("write_failure", Unwritten(failed, f"{failed} is full")))

    def _write(self, effect: Save | Begin | Append) -> str:
        if isinstance(effect, Append):
            if self.journal is not None and Append not in self.full:
                self.journal.append(effect.entry)
            return "journal" if Append in self.full and self.journal is not None else ""
        if isinstance(effect, Save):
            if Save in self.full:
                return "checkpoint"
            self.saved = encode(effect.meta, effect.arrays)
        if Begin in self.full:
            return "journal"
        self.journal = [effect.header]
        return ""


@pytest.fixture
def world(paper: Arena) -> World:
    return World(run="r", arena=paper, seed=7, epochs=0)


class Play:
    """The simulation and the sensors of a world, whose tick goes on by the driver's command."""

    def __init__(self, world: World):
        self.simulation, self._suite = Simulation(world.arena, world.seed, world.run), SensorSuite(world)

    def readings(self, driver: str) -> Readings:
        found = self._suite(self.simulation.state)
        return msgspec.structs.replace(found, driver=driver)

    def drive(self, desk: Desk, ticks: int, *followers: Desk, driver: str = "a") -> None:
        """So many ticks, which the followers see too."""
        for _ in range(ticks):
            now = self.readings(driver)
            desk.read(now)
            for one in followers:
                one.read(now)
            self.apply(desk.commands()[-1])

    def apply(self, command: Command) -> None:
        assert command.tick == self.simulation.state.tick
        self.simulation.advance(command.left, command.right, command.author, command.end)


def digest(data: bytes) -> str:
    return learner_hash(decode(data, "test")[1])


def alone(world: World, ticks: int) -> str:
    """What an agent has learned after so many ticks in one process."""
    loop = Loop(world.arena, make_setup().agent(world), world.seed, run=world.run)
    for _ in range(ticks):
        loop.step()
    return learner_hash(loop.agent.checkpoint()[1])


def kinds(effects: list[Effect]) -> list[type]:
    return [type(one) for one in effects]


def test_it_joins_with_the_readings_that_wait_and_learns_what_one_process_learns(world):
    desk, play = Desk(world), Play(world)
    assert desk.give(Event("answer", Answer("inherit", []))) == [], "of an earlier process"
    first = play.readings("a")
    assert kinds(desk.give(Event("readings", first))) == [Ask]
    assert desk.give(Event("readings", first)) == [], "one question is enough"
    assert kinds(desk.answer(world)) == [Flush, Say, Publish, Record]
    play.apply(desk.commands()[-1])
    play.drive(desk, TICKS - 1)
    assert digest(desk.checkpoint()) == alone(world, TICKS)


def test_a_doubled_question_gets_the_same_answer_and_is_learned_from_once(world):
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 20)
    before, readings = desk.checkpoint(), play.readings("a")
    assert kinds(desk.read(readings)) == [Append, Publish, Record]
    learned = desk.checkpoint()
    assert before != learned
    assert kinds(desk.read(readings)) == [Publish]
    assert desk.commands()[-1] == desk.commands()[-2]
    assert desk.read(readings, tick=readings.tick - 1) == []
    assert desk.checkpoint() == learned


def test_a_run_that_is_not_on_the_bus_is_not_joined(world):
    desk, play = Desk(world), Play(world)
    play.drive(desk, 5)
    before = desk.checkpoint()
    stray = desk.read(play.readings("a"), run="other")
    assert kinds(stray) == [Ask], "the world that answers is not that run's"
    assert desk.checkpoint() == before
    desk.give(Event("readings", msgspec.structs.replace(play.readings("a"), run="other")))
    assert desk.answer() == []
    play.drive(desk, 5)
    assert digest(desk.checkpoint()) == alone(world, 10)


def test_another_run_is_joined_with_what_was_learned(world):
    desk = Desk(world, keeps=True)
    Play(world).drive(desk, 10)
    learned = digest(desk.checkpoint())
    desk.world = msgspec.structs.replace(world, run="s", seed=8)
    effects = desk.read(Play(desk.world).readings(""))
    assert kinds(effects) == [Ask, Flush, Save, Begin, Ask]
    assert desk.journal == [b"s"]
    assert desk.machine.seat.place is Place.SEEKING
    assert digest(desk.checkpoint()) == learned
    again = continued(desk.world, desk, desk.journal or [])
    again.read(Play(desk.world).readings(""))
    assert digest(again.checkpoint()) == learned, "one that is killed in the new run has lost nothing of the old one"


def test_what_is_published_was_kept_before(world):
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 10)
    desk.now += SAVE_EVERY_S
    assert kinds(desk.read(play.readings("a"))) == [Append, Save, Publish, Record]
    assert desk.journal == [b"r"]


def test_before_the_last_answer_of_a_run_a_checkpoint_is_written(world):
    world = msgspec.structs.replace(world, epochs=5)
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 5)
    assert not desk.saved
    assert kinds(desk.read(play.readings("a"))) == [Append, Save, Publish, Record]
    assert kinds(desk.read(play.readings("a"))) == [Publish]


def continued(world: World, desk: Desk, frames: list[bytes]) -> Desk:
    """A new process with what another one has left on disk."""
    checkpoint = decode(desk.saved, "c.npz") if desk.saved else None
    return Desk(world, keeps=True, kept=Kept("c.npz", checkpoint, "c.journal", frames))


@pytest.mark.parametrize("saved", [False, True])
@pytest.mark.parametrize("torn", [0, 1])
def test_a_killed_agent_is_where_it_was(world, saved, torn):
    """Also when the newest entry was torn: nobody has heard the answer, and the tick is asked again."""
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 30)
    desk.now += SAVE_EVERY_S * saved
    play.drive(desk, 30)
    assert bool(desk.saved) is saved
    readings = play.readings("a")
    desk.read(readings)
    assert desk.journal is not None
    again = continued(world, desk, desk.journal[: len(desk.journal) - torn])
    effects = again.read(readings)
    assert Begin not in kinds(effects)
    assert again.commands() == desk.commands()[-1:]
    assert again.checkpoint() == desk.checkpoint()


def test_a_torn_journal_on_disk_is_continued_where_it_tears(world, tmp_path):
    path, play, desk = tmp_path / "c.journal", Play(world), Desk(world, keeps=True)
    store = Store(Journal(path), tmp_path / "c.npz")
    play.drive(desk, 30)
    readings = play.readings("a")
    desk.read(readings)
    for effect in desk.effects:
        if isinstance(effect, (Begin, Append)):
            assert store.carry(effect) is None
    path.write_bytes(path.read_bytes()[:-3])
    journal = Journal(path)
    found = kept.read(tmp_path / "c.npz", False, journal)
    assert (found.checkpoint, len(found.frames)) == (None, 31)
    again = Desk(world, keeps=True, kept=found)
    effects = again.read(readings)
    assert again.checkpoint() == desk.checkpoint()
    continued = Store(journal, None)
    assert [continued.carry(one) for one in effects if isinstance(one, Append)] == [None]
    assert len(Journal(path).read()) == 32
    assert kept.read(None, False, Journal(path)) == Kept(), "without --resume an older journal does not count"
    with pytest.raises(UserError, match="no such checkpoint"):
        kept.read(tmp_path / "c.npz", True, None)


def test_entries_that_the_checkpoint_contains_are_not_learned_from_again(world):
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 30)
    assert desk.journal is not None
    frames = desk.journal
    desk.now += SAVE_EVERY_S
    play.drive(desk, 1)
    again = continued(world, desk, [*frames, *desk.journal[1:]])
    again.read(play.readings(""))
    assert decode(again.checkpoint(), "again")[0] == decode(desk.checkpoint(), "desk")[0]


def test_what_it_was_at_each_tick_is_recorded_with_its_values_now_and_then(world):
    desk, play, seconds = Desk(world), Play(world), [1.0]
    play.drive(desk, 3)
    rows = [one for one in desk.effects if isinstance(one, Record)]
    make = AgentLogs("a", lambda: seconds[0])
    columns = list(zip(*(one.row for one in rows), strict=True))
    first, second = make(0, rows[0].head, columns), make(1, rows[0].head, columns)
    assert (first.run, first.seq, first.writer, first.learner, first.percept) == ("r", 0, "a", "qtable", "simple")
    assert (first.tick, len(first.values), sum(first.visits)) == ([0, 1, 2], 24 * 9, 3)
    assert (second.tick, second.values) == ([0, 1, 2], [])
    seconds[0] += 1.0
    assert make(2, rows[0].head, columns).values


def test_a_journal_of_another_run_does_not_count(world):
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 30)
    assert desk.journal is not None
    again = continued(world, desk, [b"other", *desk.journal[1:]])
    assert Begin in kinds(again.read(play.readings("a")))
    assert again.journal is not None
    assert again.journal[0] == b"r"
    assert digest(again.checkpoint()) == alone(world, 0)


def test_a_journal_that_was_given_up_is_not_continued(world):
    desk = continued(world, Desk(world), [b"r", GIVEN_UP])
    with pytest.raises(Unavailable, match=r"c\.journal: could not be written to its end; .* --resume c\.npz"):
        desk.read(Play(world).readings("a"))


def test_a_checkpoint_that_learned_elsewhere_is_told(world, paper):
    desk = Desk(world, keeps=True)
    Play(world).drive(desk, 5)
    desk.give(STOP)
    desk.answer()
    bright = msgspec.structs.replace(world, run="s", arena=msgspec.structs.replace(paper, size=(12.0, 12.0)))
    again = continued(bright, desk, [])
    again.read(Play(bright).readings(""))
    assert "c.npz: learned in the arena" in again.said()


def test_a_full_journal_is_replaced_by_a_checkpoint_before_anybody_hears_the_answer(world):
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 10)
    desk.full = {Append}
    assert kinds(desk.read(play.readings("a"))) == [Append, Warn, Save, Publish, Record]
    assert desk.journal == [b"r"]
    assert desk.saved == desk.checkpoint()
    assert "journal is full; if it dies now" in desk.said()


def test_a_disk_that_takes_nothing_ends_nothing(world):
    desk, play = Desk(world, keeps=True), Play(world)
    play.drive(desk, 10)
    desk.full = {Append, Save}
    assert kinds(desk.read(play.readings("a"))) == [Append, Warn, Save, Warn, Publish, Record]
    play.apply(desk.commands()[-1])
    assert kinds(desk.read(play.readings("a"))) == [Append, Publish, Record]
    desk.full, desk.now = {Begin}, desk.now + SAVE_EVERY_S
    assert kinds(desk.read(play.readings("a"))) == [Save, Warn, Publish], "a journal that cannot begin is not a loop"
    desk.full, desk.now = set(), desk.now + SAVE_EVERY_S
    assert kinds(desk.read(play.readings("a"))) == [Save, Publish]
    assert desk.journal == [b"r"]


def test_it_leaves_in_good_order(world):
    desk, play = Desk(world, keeps=True), Play(world)
    assert kinds(Desk(world).give(STOP)) == [Stop], "nothing has begun yet"
    play.drive(desk, 10)
    assert kinds(desk.give(STOP)) == [Flush, Ask]
    assert desk.give(STOP) == []
    assert desk.read(play.readings("a")) == []
    assert desk.give(Event("answer", Answer("world", [world]))) == []
    assert kinds(desk.answer()) == [Save, Stop]
    saves = [one for one in desk.effects if isinstance(one, Save)]
    assert saves[-1].last
    assert desk.machine.seat.place is Place.LEAVING


def test_superseded_it_leaves(world):
    desk, play = Desk(world), Play(world)
    play.drive(desk, 10)
    readings = play.readings("b")
    assert "unseated at tick 10: b drives" in next(one.text for one in desk.read(readings) if isinstance(one, Say))
    assert desk.read(readings, author="b")[-1] == desk.asked[-1]
    assert desk.asked[-1].request.verb == "release"
    assert kinds(desk.answer()) == [Stop]


def test_a_simulation_that_comes_back_is_told_again_who_stands_by(world):
    driver, play = Desk(world), Play(world)
    heir = Desk(world, mode="stand by", ident="b")
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    hand_over(driver, heir)
    heir.read(play.readings("a"))
    play.drive(driver, 1, heir)
    assert heir.asked.pop().request.verb == "stand by"
    status = Status(run="r", phase="running", driver="a")
    heir.give(Event("answer", Answer("seat", [ControlReply(ok=True, reason="", status=status)])))
    heir.now = 1.0
    asked = len(heir.asked)
    heir.give(Event("alive", ("sensors", "s")))
    play.drive(driver, 1, heir)
    assert len(heir.asked) == asked
    heir.give(Event("alive", ("sim", "sim")))
    play.drive(driver, 1, heir)
    assert heir.asked[-1].request.verb == "stand by"


def hand_over(driver: Desk, heir: Desk, ident: str = "a") -> list[Effect]:
    """Answer what the heir asks of the driver as that one does."""
    question = heir.asked[-1]
    assert (question.topic, question.agent) == ("checkpoint", ident)
    replies: list[object] = []
    driver.give(Event("checkpoint", question.request, replies.append))
    told = [one for one in driver.effects if isinstance(one, Reply)][-1]
    assert isinstance(told.message, CheckpointReply)
    return heir.answer(told.message)


def follow(world: World, play: Play, driver: Desk, heir: Desk) -> None:
    """Let the heir learn whom it follows."""
    while not any(one.topic == "checkpoint" for one in heir.asked):
        play.drive(driver, 1, heir)
    heir.asked = heir.asked[-1:]
    assert heir.asked[0].request.probe


def test_a_standby_is_the_drivers_equal_at_every_tick_and_drives_on(world):
    driver, play = Desk(world), Play(world)
    heir = Desk(world, mode="stand by", ident="b", keeps=True)
    play.drive(driver, 40)
    follow(world, play, driver, heir)
    play.drive(driver, 3, heir)
    assert kinds(hand_over(driver, heir)) == [Ask], "it fits: now it asks for everything"
    assert not heir.asked[-1].request.probe
    play.drive(driver, 7, heir)
    hand_over(driver, heir)
    assert heir.machine.seat.place is Place.IN_STEP
    for _ in range(20):
        play.drive(driver, 1, heir)
        assert digest(heir.checkpoint()) == digest(driver.checkpoint())
    assert heir.commands() == []
    readings = play.readings("b")  # the driver is gone
    heir.read(readings)
    play.apply(heir.commands()[-1])
    play.drive(heir, 20, driver="b")
    assert digest(heir.checkpoint()) == alone(world, play.simulation.state.tick)


def test_a_standby_asks_nothing_of_a_former_leader_while_the_new_driver_has_not_driven(world):
    driver, play = Desk(world), Play(world)
    heir = Desk(world, mode="stand by", ident="b")
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    hand_over(driver, heir)
    heir.read(play.readings("b"))  # the driver is gone
    play.apply(heir.commands()[-1])
    heir.now += 2 * INHERIT_WITHIN_S
    asked = len(heir.asked)
    heir.read(play.readings("c"))
    assert [one.topic for one in heir.asked[asked:]] in ([], ["control"])


def test_a_standby_that_missed_a_tick_inherits_again(world):
    driver, play = Desk(world), Play(world)
    heir = Desk(world, mode="stand by", ident="b")
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    hand_over(driver, heir)
    play.drive(driver, 2)
    play.drive(driver, 1, heir)
    assert heir.machine.seat.place is Place.QUEUED
    hand_over(driver, heir)
    assert heir.machine.seat.place is Place.IN_STEP
    assert digest(heir.checkpoint()) == digest(driver.checkpoint())


def test_a_standby_that_missed_the_tick_before_it_sits_down_asks_once_more(world):
    driver, play = Desk(world), Play(world)
    heir = Desk(world, mode="stand by", ident="b")
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    hand_over(driver, heir)
    play.drive(driver, 1)
    heir.read(play.readings("b"))  # the driver leaves in good order
    assert heir.commands() == []
    hand_over(driver, heir)
    play.apply(heir.commands()[-1])
    play.drive(heir, 20, driver="b")
    assert digest(heir.checkpoint()) == alone(world, play.simulation.state.tick)


def test_a_stray_message_of_another_run_does_not_disturb_an_inheritance(world):
    driver, heir, play = Desk(world), taker(world), Play(world)
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    heir.read(play.readings("b"))
    (question,) = heir.asked
    assert kinds(heir.read(play.readings("b"), run="other")) == [Ask]
    heir.asked = [question]
    hand_over(driver, heir)
    play.apply(heir.commands()[-1])
    play.drive(heir, 20, driver="b")
    assert digest(heir.checkpoint()) == alone(world, play.simulation.state.tick)


def test_a_standby_whose_driver_does_not_answer_learns_in_its_shadow_and_asks_again(world):
    driver, play = Desk(world), Play(world)
    heir = Desk(world, mode="stand by", ident="b")
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    heir.answer()
    assert "inherited nothing: a does not answer" in heir.said()
    assert heir.machine.seat.place is Place.SHADOWING
    play.drive(driver, 3, heir)
    assert heir.asked == []
    heir.now += 10.0
    play.drive(driver, 1, heir)
    hand_over(driver, heir)
    assert heir.machine.seat.place is Place.IN_STEP


def test_a_standby_whose_question_for_the_kind_is_lost_asks_for_it_again(world):
    driver, play = Desk(world), Play(world)
    heir = Desk(world, mode="stand by", ident="b")
    follow(world, play, driver, heir)
    heir.answer()
    assert heir.machine.seat.place is Place.SHADOWING
    play.drive(driver, 3, heir)
    assert heir.asked == []
    heir.now += INHERIT_WITHIN_S
    play.drive(driver, 1, heir)
    assert heir.asked[-1].request.probe
    hand_over(driver, heir)
    hand_over(driver, heir)
    assert heir.machine.seat.place is Place.IN_STEP
    assert "inherited nothing" not in heir.said()


def taker(world: World, **options) -> Desk:
    return Desk(world, mode="take over", ident="b", **options)


def test_a_taker_over_inherits_when_it_sits_down(world):
    driver, heir, play = Desk(world), taker(world), Play(world)
    play.drive(driver, 40)
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    play.drive(driver, 5, heir)
    readings = play.readings("b")
    driver.read(readings)
    assert kinds(heir.read(readings)) == [Say, Ask]
    assert heir.read(readings) == [], "the tick waits for what is inherited"
    stale = Answer("inherit r a 99", [CheckpointReply()])
    assert heir.give(Event("answer", stale)) == []
    hand_over(driver, heir)
    assert f"inherited what a knew at tick {readings.tick - 1}" in heir.said()
    play.apply(heir.commands()[-1])
    play.drive(heir, 20, driver="b")
    assert digest(heir.checkpoint()) == alone(world, play.simulation.state.tick)


def test_readings_that_were_overtaken_do_not_unseat_who_has_inherited(world):
    driver, heir, play = Desk(world), taker(world), Play(world)
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    play.drive(driver, 5, heir)
    overtaken, readings = play.readings("a"), play.readings("b")
    heir.read(overtaken)
    heir.read(readings)
    hand_over(driver, heir)
    for stale in (overtaken, msgspec.structs.replace(overtaken, tick=overtaken.tick - 1), overtaken):
        assert heir.read(stale) == []
        assert heir.machine.seat.place is Place.DRIVING
        assert kinds(heir.read(readings)) == [Publish], "the same answer as before"
    play.apply(heir.commands()[-1])
    play.drive(heir, 20, driver="b")
    assert digest(heir.checkpoint()) == alone(world, play.simulation.state.tick)


def test_a_lost_question_for_what_the_predecessor_knows_is_put_again(world):
    driver, heir, play = Desk(world), taker(world), Play(world)
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    play.drive(driver, 5, heir)
    heir.asked.clear()
    heir.read(play.readings("b"))
    assert heir.machine.deadline == heir.now + ASK_AGAIN_S
    assert heir.give(TIME) == [], "not yet"
    began = heir.now
    while heir.machine.deadline < math.inf:
        heir.now = heir.machine.deadline
        (again,) = heir.give(TIME)
        assert isinstance(again, Ask)
        assert heir.now + again.timeout == began + INHERIT_WITHIN_S
    assert len(heir.asked) == INHERIT_WITHIN_S / ASK_AGAIN_S
    hand_over(driver, heir)
    play.apply(heir.commands()[-1])
    assert heir.answer() == [], "the other questions are of no interest any more"
    play.drive(heir, 20, driver="b")
    assert digest(heir.checkpoint()) == alone(world, play.simulation.state.tick)


def test_a_predecessor_that_is_gone_is_asked_once(world):
    driver, heir, play = Desk(world), taker(world), Play(world)
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    play.drive(driver, 5, heir)
    heir.asked.clear()
    heir.read(play.readings("b"))
    heir.answer()
    assert "inherited nothing: a does not answer" in heir.said()
    assert (heir.asked, heir.machine.deadline, len(heir.commands())) == ([], math.inf, 1)


@pytest.mark.parametrize("named", ["", "b"])
def test_who_died_before_it_inherited_asks_the_last_author_when_it_is_back(world, named):
    """The seat is free, or readings still name its former self."""
    driver, play = Desk(world), Play(world)
    play.drive(driver, 40)
    driver.read(play.readings("b"))
    again = taker(world)
    again.read(play.readings(named))
    again.read(play.readings("b"))
    hand_over(driver, again)
    play.apply(again.commands()[-1])
    play.drive(again, 20, driver="b")
    assert digest(again.checkpoint()) == alone(world, play.simulation.state.tick)


def test_who_has_driven_last_asks_nobody(world):
    driver, heir, play = Desk(world), taker(world), Play(world)
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    play.drive(driver, 5, heir)
    heir.asked.clear()
    heir.read(play.readings("b"), author="b")
    assert heir.asked == []
    assert heir.commands()


def test_behind_an_agent_of_another_kind_it_learns_from_what_that_one_does(world):
    driver, play = Desk(world), Play(world)
    heir = taker(world, setup=make_setup(percept="rich"))
    follow(world, play, driver, heir)
    hand_over(driver, heir)
    assert heir.machine.seat.place is Place.SHADOWING
    before = digest(heir.checkpoint())
    play.drive(driver, 30, heir)
    assert digest(heir.checkpoint()) != before
    heir.read(play.readings("b"))
    hand_over(driver, heir)
    assert "inherited nothing: a is qtable with the percept simple" in heir.said()
    assert heir.commands()


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (lambda data: data[:-100], "a: not a checkpoint, or truncated"),
        (lambda data: data, "inherited nothing: a has not driven in this run"),
    ],
)
def test_what_cannot_be_inherited_is_told_and_it_drives_on_with_what_it_has(
    world, data: Callable[[bytes], bytes], line
):
    other = Desk(msgspec.structs.replace(world, run="other"))
    Play(other.world).drive(other, 5)
    heir, play = taker(world), Play(world)
    heir.read(play.readings("a"))
    heir.asked.clear()
    heir.read(play.readings("b"))
    heir.answer(CheckpointReply(data=data(other.checkpoint())))
    assert line in heir.said()
    assert heir.commands()


def test_the_answer_of_an_earlier_run_is_not_inherited(world):
    heir, play = taker(world), Play(world)
    heir.read(play.readings("a"))
    heir.asked.clear()
    heir.read(play.readings("b"))
    (question,) = heir.asked
    heir.world = msgspec.structs.replace(world, run="s")
    heir.read(Play(heir.world).readings("b"))
    before = heir.checkpoint()
    donor = Desk(world)
    Play(world).drive(donor, 5)
    assert heir.give(Event("answer", Answer(question.tag, [CheckpointReply(data=donor.checkpoint())]))) == []
    assert heir.checkpoint() == before


def test_who_asks_another_agent_or_nothing_gets_no_answer(world):
    desk = Desk(world)
    heard: list[object] = []
    for request in (None, CheckpointRequest(agent="b", learner="qtable", percept="simple")):
        assert desk.give(Event("checkpoint", request, heard.append)) == []
    (told,) = desk.give(
        Event("checkpoint", CheckpointRequest(agent="a", learner="qtable", percept="simple"), heard.append)
    )
    assert isinstance(told, Reply)
    assert told.message == CheckpointReply(reason="knows nothing yet")


def test_many_robots_are_driven_by_the_same_machine(world):
    many = msgspec.structs.replace(world, robots=3)
    none, light = pack(np.zeros(3)), pack(np.full((2, 3), 0.1))
    readings = BatchReadings(
        run="r", tick=0, epoch=0, episode=pack(np.zeros(3), COUNT), sonar=pack(np.full((16, 3), 5.0)), light=light,
        contact=pack(np.zeros((2, 3)), FLAG), left=none, right=none, author="", driver="a",
    )  # fmt: skip
    desk = Desk(many, keeps=True)
    desk.give(Event("batch/readings", readings))
    effects = desk.answer(many)
    assert kinds(effects) == [Flush, Begin, Say, Publish, Record], "no journal of its ticks is kept"
    assert [one.topic for one in effects if isinstance(one, Publish)] == ["batch/command"]
    (refused,) = desk.give(Event("batch/readings", msgspec.structs.replace(readings, tick=1, sonar=b"")))
    assert isinstance(refused, Refuse)
    assert desk.give(Event("readings", Play(world).readings("a"))) == [], "those of one robot do not belong here"
    taking = taker(many)
    taking.give(Event("batch/readings", readings))
    taking.answer(many)
    assert [one.topic for one in taking.asked] == ["control"], "nobody is its equal before it sits down"
    taking.give(Event("batch/readings", msgspec.structs.replace(readings, driver="b")))
    assert taking.asked[-1].agent == "a"
    heir = Desk(many, mode="stand by")
    heir.give(Event("batch/readings", readings))
    with pytest.raises(UserError, match="a standby keeps in step with the driver of one robot; this world has 3"):
        heir.answer(many)


def test_what_is_inherited_replaces_what_was_remembered(world):
    driver, heir, play = Desk(world), Desk(world), Play(world)
    play.drive(driver, 3)
    Play(world).drive(heir, 2)
    assert driver.machine.agent is not None
    assert heir.machine.agent is not None
    heir.machine.agent.restore(*driver.machine.agent.checkpoint(), "a")
    assert heir.checkpoint() == driver.checkpoint()
