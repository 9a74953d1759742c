"""The simulation's machine: one command a tick, one driver, and what is in the journal before anybody hears of it."""

import math
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import msgspec
import pytest
from phototaxis.runtime.machine import (
    START,
    STOP,
    TIME,
    Append,
    Begin,
    Effect,
    Event,
    Flush,
    Listen,
    Publish,
    Record,
    Refusal,
    Refuse,
    Reply,
    Say,
    Stop,
    Unwritten,
    Warn,
)  # fmt: skip
from phototaxis.runtime.transitions import diagram
from phototaxis.wire.messages import Command, Control, ControlReply, RecordingProgress, State, Status
from phototaxis_sim import arenas
from phototaxis_sim.continued import Continued, continued
from phototaxis_sim.pace import Pace
from phototaxis_sim.phases import TABLE, Phase
from phototaxis_sim.simulation import Simulation
from phototaxis_sim.stepper import Stepper
from transitions import assert_all_taken

PAPER = arenas.load("paper")
PERIOD = PAPER.motion.control_period


class Desk:
    """A machine with a clock that is wound by hand, and all that came out of it."""

    def __init__(
        self, epochs: int = 0, speed: float = 0.0, driver_timeout: float = 5.0, found: Continued | None = None
    ):
        suffixes = count()
        fresh = Simulation(PAPER, 3, "r", epochs)
        self.machine = Stepper(fresh, Pace(PERIOD, speed), lambda: f"{next(suffixes):04x}", found, driver_timeout)
        self.now, self.all = 0.0, list[Effect]()
        self.out = self.give(START)

    @property
    def phase(self) -> Phase:
        return self.machine.steps.state

    @property
    def tick(self) -> int:
        return self.machine.steps.tick

    def give(self, event: Event) -> list[Effect]:
        self.out = self.machine.on(event, self.now)
        self.all += self.out
        return self.out

    def wish(self, verb: str, agent: str = "") -> list[Effect]:
        """A request whose answer does not matter."""
        return self.give(Event("control", msgspec.convert({"verb": verb, "agent": agent}, Control), lambda _: None))

    def ask(self, verb: str, agent: str = "", **more: Any) -> ControlReply:
        """A request, and the answer to it."""
        asked = msgspec.convert({"verb": verb, "agent": agent, **more}, Control)
        (answer,) = (
            one.message for one in self.give(Event("control", asked, lambda _: None)) if isinstance(one, Reply)
        )
        assert isinstance(answer, ControlReply)
        return answer

    def command(self, author: str = "a", tick: int | None = None, left: float = 1.0, **more: Any) -> list[Effect]:
        at = self.tick if tick is None else tick
        message = Command(**{"run": self.machine.steps.simulation.world.run, "tick": at, "author": author,
                             "left": left, "right": 0.5, **more})  # fmt: skip
        return self.give(Event("command", message))

    def wait(self, seconds: float) -> list[Effect]:
        """Let time pass, deadline by deadline; what came out."""
        until, came = self.now + seconds, list[Effect]()
        while self.machine.deadline < until:
            self.now = max(self.machine.deadline, self.now)
            came += self.give(TIME)
        self.now = until
        return came

    def status(self) -> Status:
        return self.ask("status").status

    def log(self) -> list[int]:
        """The ticks that were recorded."""
        return [one.row[0] for one in self.all if isinstance(one, Record)]


def kinds(effects: list[Effect]) -> list[type]:
    return [type(one) for one in effects]


def published(effects: list[Effect], topic: str) -> list[Any]:
    return [one.message for one in effects if isinstance(one, Publish) and one.topic == topic]


def seated(**options: Any) -> Desk:
    desk = Desk(**options)
    assert desk.ask("claim", "a").ok
    return desk


def test_a_step_is_in_the_journal_before_anybody_hears_of_it_and_recorded_afterwards():
    desk = seated()
    assert desk.phase is Phase.ASKING
    assert kinds(desk.command()) == [Say, Append, Publish, Record]
    assert kinds(desk.command()) == [Append, Publish, Record]
    assert desk.tick == 2
    assert desk.log() == [0, 1]
    end = desk.command(end="truncated")
    assert kinds(end) == [Begin, Publish, Record, Publish]
    assert published(end, "episode")[0].steps == 2


def test_a_command_counts_once_for_its_tick_and_from_the_driver_alone():
    desk = seated()
    desk.command()
    state = desk.machine.steps.simulation.state
    mistakes: list[dict[str, Any]] = [{"tick": 0}, {"tick": 2}, {"author": "b"}, {"author": ""}, {"run": "other"}]
    for wrong in mistakes:
        (refused,) = desk.command(**wrong)
        assert isinstance(refused, Refuse)
    assert desk.machine.steps.simulation.state is state
    assert desk.status().refused == {
        "command: late or repeated": 2, "command: not the driver": 2, "command: another run": 1
    }  # fmt: skip
    desk.give(Event("refused", Refusal("command", "oversized: 5000 bytes")))
    assert desk.status().refused["command: oversized"] == 1


def test_an_unanswered_tick_is_asked_again_and_again():
    desk = seated()
    again = published(desk.wait(1.0), "state")
    assert 3 <= len(again) <= 5
    assert {one.tick for one in again} == {0}


def test_a_former_driver_commands_no_more_after_the_boundary():
    desk = seated()
    assert desk.ask("take over", "b", at=2).ok
    desk.command()
    asked = published(desk.command(), "state")
    assert [one.driver for one in asked] == ["b"]
    assert kinds(desk.command("a")) == [Refuse]
    assert Append in kinds(desk.command("b"))


def test_the_last_answer_is_awaited_recorded_and_not_applied():
    desk = seated(epochs=2)
    for _ in range(2):
        desk.command()
    last = desk.command()
    assert kinds(last) == [Record, Flush, Say, Publish]
    assert desk.phase is Phase.FINISHED
    assert desk.status().phase == "finished"
    assert desk.log() == [0, 1, 2]
    assert kinds(desk.command()) == []
    assert desk.ask("reset").reason == "the run is finished"
    assert not published(desk.wait(5), "state")
    assert desk.ask("begin", seed=9).status.run == "r.0000"
    assert desk.phase is Phase.ASKING


def test_pause_step_and_resume():
    desk = seated()
    assert not desk.ask("step").ok
    assert desk.ask("pause").status.phase == "paused"
    assert desk.status().waiting_for == "the command of a"
    assert kinds(desk.command()) == [Say, Record]
    assert desk.tick == 0
    desk.ask("step")
    assert desk.tick == 1
    desk.ask("step")
    desk.command()
    assert desk.tick == 2
    desk.command()
    desk.ask("resume")
    assert (desk.tick, desk.phase) == (3, Phase.ASKING)
    assert desk.log() == [0, 1, 2]


def test_a_simulation_that_is_asked_to_stop_waits_for_the_answer_but_not_for_long():
    answered, silent, free = seated(), seated(), Desk()
    answered.ask("stop")
    assert answered.phase is Phase.ENDING
    assert not answered.ask("begin").ok
    assert not answered.ask("reset").ok
    assert kinds(answered.command())[-1] is Stop
    silent.ask("stop")
    assert Stop not in kinds(silent.wait(1.9))
    assert Stop in kinds(silent.wait(0.3))
    free.ask("stop")
    assert Stop in kinds(free.out)
    assert all(published(one.all, "status") for one in (answered, silent, free))


def test_a_silent_driver_loses_the_seat_to_who_waits_for_it():
    desk = seated(driver_timeout=1.0)
    desk.wait(5)
    assert desk.status().driver == "a"
    desk.ask("stand by", "b")
    desk.wait(0.5)
    assert desk.status().driver == "b"
    desk.give(Event("gone", ("agent", "b")))
    assert desk.phase is Phase.WAITING


def test_in_real_time_the_newest_command_holds_until_it_is_stale():
    desk = seated(speed=1.0)
    desk.command(left=0.25)
    assert desk.tick == 0
    desk.wait(PERIOD * 1.01)
    assert desk.tick == 1
    states = published(desk.wait(3 * PERIOD), "state")
    lefts = {one.tick: one.left for one in states}
    assert (lefts[2], lefts[4]) == (0.25, 0.0)
    assert desk.status().late == 3
    assert desk.ask("speed", speed=0).ok
    assert desk.out[0] == Listen("readings", False)


def test_a_held_command_is_applied_when_lockstep_begins():
    desk = seated(speed=1.0)
    desk.command(left=0.25)
    desk.ask("speed", speed=0)
    assert (desk.tick, desk.machine.steps.simulation.state.left) == (1, 0.25)


def test_a_continued_simulation_keeps_the_seat_for_who_took_over_as_the_episode_ended():
    desk = seated()
    desk.ask("take over", "b", at=1)
    (begun,) = (one for one in desk.command(end="truncated") if isinstance(one, Begin))
    found = continued([begun.header], Simulation(PAPER, 3, "r"), Path("journal"))
    assert Desk(found=found).machine.steps.seat.heir == "b"


def test_a_part_that_is_too_slow_is_named_once():
    desk = seated(speed=100.0)
    said = [one.text for one in desk.wait(2) if isinstance(one, Say)]
    assert said == [line for line in said if "a is too slow" in line]
    assert len(said) == 1


def test_a_killed_simulation_continues_and_keeps_the_seat_for_its_driver():
    first = seated()
    frames = [msgspec.msgpack.encode(Simulation(PAPER, 3, "r").snapshot([], ""))]
    for left in (1.0, 0.5, -1.0):
        frames += [one.entry for one in first.command(left=left) if isinstance(one, Append)]
    found = continued(frames, Simulation(PAPER, 3, "r"), Path("journal"))
    second = Desk(found=found)
    assert second.log() == [0, 1, 2]
    assert second.machine.steps.simulation.state.hash == first.machine.steps.simulation.state.hash
    assert second.ask("claim", "b").reason == "the seat is kept for a"
    second.ask("stand by", "b")
    second.wait(2.9)
    assert second.status().driver == ""
    second.wait(0.2)
    assert second.status().driver == "b"


def test_a_journal_of_another_run_continues_nothing_and_one_begun_by_request_its_own():
    fresh = Simulation(PAPER, 3, "r")
    other, later = Simulation(PAPER, 3, "s").snapshot([], ""), Simulation(PAPER, 8, "r.00ff").snapshot([], "")
    assert continued([], fresh, Path("j")) is None
    assert continued([msgspec.msgpack.encode(other)], fresh, Path("j")) is None
    found = continued([msgspec.msgpack.encode(later)], fresh, Path("j"))
    assert found is not None
    assert (found.simulation.world.run, found.simulation.world.seed) == ("r.00ff", 8)


def test_a_journal_that_cannot_be_written_is_told_until_the_next_episode():
    desk = seated()
    assert kinds(desk.give(Event("write_failure", Unwritten("journal", "j: no space left")))) == [Warn]
    assert "cannot be continued" in desk.status().warnings[0]
    desk.command(end="truncated")
    assert desk.status().warnings == []


def test_the_status_tells_what_is_missing_and_what_the_recorder_warns_of():
    desk = Desk()
    assert desk.status().waiting_for == "sensors and agent"
    desk.give(Event("alive", ("sensors", "s")))
    desk.give(Event("alive", ("agent", "a")))
    assert desk.status().waiting_for == "an agent to take the seat"
    desk.ask("claim", "a")
    assert desk.status().phase == "running"
    desk.wait(1.0)
    assert desk.status().waiting_for == "the command of a"
    desk.give(Event("recording", RecordingProgress(run="r", tick=1, warning="little space")))
    assert desk.status().warnings == ["little space"]


def test_requests_that_cannot_be_met_say_why():
    desk = seated()
    assert desk.ask("claim", "b").reason == "the seat is taken by a"
    assert desk.ask("release", "b").reason == "b does not hold the seat"
    assert desk.ask("claim").reason == "a claim names its agent"
    (answer,) = desk.give(Event("control", None, lambda _: None))
    assert isinstance(answer, Reply)
    assert answer.message == ControlReply(ok=False, reason="an empty request", status=desk.status())


def test_the_world_is_told_and_the_machine_asks_for_time_only_when_it_needs_it():
    desk = Desk(epochs=1)
    (told,) = desk.give(Event("world", None, lambda _: None))
    assert isinstance(told, Reply)
    assert told.message is desk.machine.steps.simulation.world
    assert desk.machine.deadline < math.inf
    assert isinstance(published(desk.all, "state")[0], State)


def _in_every_phase(given: Callable[[Desk], object]) -> Callable[[], None]:
    """Give the same in each phase."""

    def scenario() -> None:
        for prepare in (lambda _: None, lambda d: d.ask("claim", "a"), lambda d: d.ask("pause"), _finish, _ending):
            desk = Desk(epochs=1)
            prepare(desk)
            given(desk)
            desk.wait(3.0)

    return scenario


def _finish(desk: Desk) -> None:
    desk.ask("claim", "a")
    desk.command()
    desk.command()


def _ending(desk: Desk) -> None:
    desk.ask("claim", "a")
    desk.ask("stop")


def _paused_at_the_end(desk: Desk) -> None:
    desk.ask("claim", "a")
    desk.command()
    desk.ask("pause")
    desk.command()


def _ending_at_the_end(desk: Desk) -> None:
    desk.ask("claim", "a")
    desk.command()
    desk.ask("stop")
    desk.command()


def test_every_transition_is_taken():
    verbs = ("pause", "resume", "begin", "stop")
    asked = [_in_every_phase(lambda desk, verb=verb: desk.ask(verb)) for verb in verbs]
    others = (
        lambda desk: desk.give(STOP),
        lambda desk: [desk.wish(verb, agent) for verb, agent in (("release", "a"), ("reset", ""), ("claim", "b"))],
        lambda desk: (desk.wish("take over", "b"), desk.give(Event("gone", ("agent", "a")))),
        lambda desk: desk.give(Event("gone", ("agent", "a"))),
    )
    ends = [lambda end=end: end(Desk(epochs=1)) for end in (_paused_at_the_end, _ending_at_the_end)]
    assert_all_taken(TABLE, [*asked, *map(_in_every_phase, others), *ends])


def test_the_documented_diagram_is_the_table():
    assert diagram(TABLE) in (Path(__file__).parents[2] / "ARCHITECTURE.md").read_text()


@pytest.mark.parametrize("given", [STOP, TIME])
def test_nothing_follows_after_the_end(given: Event):
    desk = seated()
    assert Stop in kinds(desk.give(STOP))
    assert desk.phase is Phase.ENDED
    assert Stop not in kinds(desk.give(given))


def test_a_command_of_a_former_driver_is_not_applied():
    paused = seated()
    paused.ask("stand by", "b")
    paused.ask("pause")
    paused.command("a")
    paused.give(Event("gone", ("agent", "a")))
    assert paused.status().waiting_for == "the command of b"
    paused.ask("resume")
    assert paused.tick == 0
    clocked = seated(speed=1.0)
    clocked.command("a", left=0.25)
    clocked.give(Event("gone", ("agent", "a")))
    clocked.ask("claim", "b")
    clocked.wait(PERIOD * 1.01)
    state = clocked.machine.steps.simulation.state
    assert (state.tick, state.author, clocked.status().late) == (1, "", 1)


def test_patience_ends_at_its_deadline_whatever_the_clock_shows():
    for began in range(1, 1000):
        desk = Desk(driver_timeout=0.1)
        desk.now = began / 7
        desk.ask("claim", "a")
        desk.ask("stand by", "b")
        desk.now = desk.machine.steps.heard_at + 0.1
        desk.give(TIME)
        assert desk.machine.steps.seat.driver == "b", began
