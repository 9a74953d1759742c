"""The sensors' machine: one answer for each state, whatever comes twice, late, from elsewhere or not at all."""

import random
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.machine import STOP, TIME, Answer, Ask, Effect, Event, Publish, Record, Refuse, Say, Stop
from phototaxis.runtime.transitions import diagram
from phototaxis.wire.columns import unpack
from phototaxis.wire.messages import SimLog, State, World
from phototaxis_sensors.choice import BuiltInFactory, make_suite
from phototaxis_sensors.model import BuiltIn, Moment
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.sensing import TABLE, Sensing
from phototaxis_sensors.server import chunk
from phototaxis_sensors.suite import Models, SensorSuite, built_in
from phototaxis_sim import arenas
from phototaxis_sim.batch_simulation import BatchSimulation
from transitions import assert_all_taken

PAPER = arenas.load("paper")
QUIET = msgspec.structs.replace(PAPER, sensing=msgspec.structs.replace(PAPER.sensing, noise=0.0))
NO_WORLD = Event("answer", Answer("world", []))


class Odometer(BuiltIn):
    """A sonar whose ranges say how often it was asked in this episode, and of which tick before this one."""

    name, stateful = "odometer", True

    def __init__(self):
        self.episode, self.ticks, self.anew = -1, list[int](), list[int]()

    def __call__(self, moment: Moment) -> Sequence[float]:
        if moment.episode != self.episode:
            self.episode, self.ticks = moment.episode, []
        self.ticks.append(moment.tick)
        return [float(len(self.ticks))] * 16

    def begun_anew(self, tick: int) -> None:
        self.anew.append(tick)


class Remembering(BuiltInFactory):
    """Makes suites whose sonar is an odometer."""

    def __call__(self, arena: Arena, scene: Scene) -> Models:
        self.sonar = Odometer()
        return Models(self.sonar, built_in(arena, scene).light)


def state(tick: int, run: str = "r", **changes: Any) -> State:
    """A state, with changes."""
    fields: dict[str, Any] = {
        "run": run, "tick": tick, "episode": 0, "epoch": tick, "time": 0.5 * tick, "x": 1.0, "y": 5.0, "heading": 0.0,
        "speed": 0.0, "turn": 0.0, "front": False, "rear": False, "left": 0.0, "right": 0.0, "author": "",
        "driver": "", "hash": "",
    }  # fmt: skip
    return State(**{**fields, **changes})


def asks(tick: int, run: str = "r", **changes: Any) -> Event:
    return Event("state", state(tick, run, **changes))


def world(run: str = "r", robots: int = 1, arena: Arena = PAPER) -> Event:
    message = World(run=run, arena=arena, seed=3, epochs=0, robots=robots)
    return Event("answer", Answer("world", [message]))


def log(first: int, last: int, episode: int = 0, run: str = "r") -> SimLog:
    """What the simulation's log has of the ticks from `first` to `last`."""
    ticks = list(range(first, last + 1))
    some, none = [1.0] * len(ticks), [0] * len(ticks)
    return SimLog(
        run=run, seq=0, writer="sim", driver="", tick=ticks, episode=[episode] * len(ticks), time=some, x=some, y=some,
        heading=some, left=some, right=some, contact=none, ended=[],
    )  # fmt: skip


def recalled(*chunks: SimLog) -> Event:
    return Event("answer", Answer("log/sim", chunks))


def play(machine: Sensing, *events: Event) -> list[Effect]:
    """What follows from the last of several events."""
    effects: list[Effect] = []
    for event in events:
        effects = machine.on(event, now=0.0)
    return effects


def answers(effects: Sequence[Effect]) -> list[Any]:
    """The readings that are published."""
    return [effect.message for effect in effects if isinstance(effect, Publish)]


def published(effects: Sequence[Effect]) -> list[int]:
    return [readings.tick for readings in answers(effects)]


def sensing(choice: BuiltInFactory | None = None) -> Sensing:
    return Sensing(partial(make_suite, choice or BuiltInFactory()))


def serving() -> Sensing:
    """A machine that has answered tick 0 of the run "r"."""
    machine = sensing()
    play(machine, asks(0), world())
    return machine


def test_the_state_that_waits_is_answered_when_its_world_comes():
    machine = sensing()
    assert play(machine, asks(4)) == [Ask("world", "world")]
    said, answer, record = play(machine, world())
    assert said == Say("senses in the run r; robots: 1")
    readings = SensorSuite(World(run="r", arena=PAPER, seed=3, epochs=0))(state(4))
    assert answer == Publish("readings", readings)
    assert record == Record(("r", "built-in", "built-in"), (4, readings.sonar, readings.light))


def test_while_the_world_is_asked_for_the_newest_state_waits():
    machine = sensing()
    assert play(machine, asks(0), asks(2)) == []
    assert play(machine, asks(1)) == []
    assert published(play(machine, world())) == [2]


def test_a_tick_is_answered_again_but_recorded_once():
    machine = serving()
    first = play(machine, asks(1))
    assert [type(effect) for effect in first] == [Publish, Record]
    assert play(machine, asks(1)) == first[:1]
    assert play(machine, asks(0)) == [], "an older tick is over"


def test_an_answer_that_is_repeated_names_the_present_driver_and_is_another_message():
    machine = serving()
    (before,) = answers(play(machine, asks(1, driver="a")))
    (after,) = answers(play(machine, asks(1, driver="b")))
    assert (before.driver, after.driver) == ("a", "b")
    assert msgspec.structs.replace(after, driver="a") == before


def test_another_run_is_joined():
    machine = serving()
    assert play(machine, asks(0, "s", x=2.0)) == [Ask("world", "world")]
    said, answer, record = play(machine, world("s"))
    assert said == Say("senses in the run s; robots: 1")
    assert [readings.run for readings in answers([answer])] == ["s"]
    assert isinstance(record, Record)
    assert record.head[0] == "s"


def test_without_a_world_the_next_state_asks_again():
    machine = sensing()
    assert play(machine, asks(0), NO_WORLD) == []
    assert play(machine, asks(0)) == [Ask("world", "world")]
    assert play(machine, world("of another run")) == []
    assert play(machine, asks(0)) == [Ask("world", "world")]
    assert published(play(machine, world())) == [0]


def test_a_stray_state_of_another_run_changes_nothing():
    choice = Remembering()
    machine = sensing(choice)
    play(machine, asks(0), world(), recalled(), asks(1))
    assert play(machine, asks(7, "stray")) == [Ask("world", "world")]
    assert published(play(machine, asks(2))) == [2], "the run goes on while the stray's world is asked for"
    assert play(machine, world()) == []
    assert published(play(machine, asks(9, "stray"), world(), asks(3))) == [3]
    assert choice.sonar.ticks == [0, 1, 2, 3]


def test_answers_that_nobody_waits_for_are_dropped():
    machine = serving()
    for event in (world("s"), NO_WORLD, recalled(log(0, 3)), TIME, Event("alive", ("sim", "s"))):
        assert play(machine, event) == []
    assert published(play(machine, asks(1))) == [1]


def test_models_that_remember_are_led_through_the_episode():
    choice = Remembering()
    machine = sensing(choice)
    said, ask = play(machine, asks(12, episode=2), world())
    assert isinstance(said, Say)
    assert isinstance(ask, Ask)
    assert (ask.tag, ask.topic, ask.every) == ("log/sim", "log/sim", True)
    chunks = log(5, 8, episode=1), log(9, 12, episode=2), log(0, 20, run="another")
    (answer,) = answers(play(machine, recalled(*chunks)))
    assert choice.sonar.ticks == [9, 10, 11, 12]
    assert choice.sonar.anew == []
    assert all(3.0 < distance < 5.0 for distance in answer.sonar), "the fourth tick of the episode, with noise"


def test_states_that_come_while_the_log_is_asked_for_count_as_past():
    choice = Remembering()
    machine = sensing(choice)
    assert play(machine, asks(2), world(), asks(3), asks(3), asks(5), asks(4), asks(9, "stray")) == []
    assert published(play(machine, recalled(log(0, 1)))) == [5]
    assert choice.sonar.ticks == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("chunks", "anew"),
    [
        ([], [12]),
        ([log(10, 11)], [10]),
        ([log(8, 9, episode=1), log(10, 11)], []),
        ([log(0, 11)], []),
        ([log(8, 9, episode=1)], [12]),
    ],
)
def test_models_are_told_what_the_log_has_no_more(chunks: list[SimLog], anew: list[int]):
    choice = Remembering()
    play(sensing(choice), asks(12), world(), recalled(*chunks))
    assert choice.sonar.anew == anew
    assert choice.sonar.ticks[-1] == 12


def test_the_first_tick_of_a_run_lacks_no_past():
    choice = Remembering()
    play(sensing(choice), asks(0), world(), recalled())
    assert choice.sonar.anew == []


def many(robots: int = 3) -> BatchSimulation:
    return BatchSimulation(QUIET, 3, "r", robots=robots)


def test_many_robots_take_the_same_path():
    machine, found = sensing(), many().state
    assert play(machine, Event("batch/state", found)) == [Ask("world", "world")]
    said, answer, record = play(machine, world(robots=3, arena=QUIET))
    assert said == Say("senses in the run r; robots: 3")
    assert isinstance(answer, Publish)
    assert isinstance(record, Record)
    assert answer.topic == "batch/readings"
    (readings,) = answers([answer])
    sonar, light = unpack(readings.sonar, 3, 16), unpack(readings.light, 3, 2)
    assert record.row == (0, sonar[:, 0].tolist(), light[:, 0].tolist())
    x, y, heading = unpack(found.pose, 3, 3)
    suite = SensorSuite(World(run="r", arena=QUIET, seed=3, epochs=0))
    for robot in range(3):
        alone = suite(state(0, x=x[robot], y=y[robot], heading=heading[robot]))
        assert sonar[:, robot] == pytest.approx(alone.sonar, abs=1e-9)
        assert light[:, robot] == pytest.approx(alone.light, abs=1e-9)
    assert play(machine, Event("batch/state", found)) == [answer]


def test_a_state_of_the_wrong_number_of_robots_is_refused():
    machine, found = sensing(), many().state
    play(machine, Event("batch/state", found), world(robots=3))
    other = msgspec.structs.replace(many(2).state, tick=1)
    (refusal,) = play(machine, Event("batch/state", other))
    assert isinstance(refusal, Refuse)
    assert refusal.topic == "batch/state"
    assert published(play(machine, Event("batch/state", msgspec.structs.replace(found, tick=1)))) == [1]


def test_a_state_on_the_topic_of_another_number_of_robots_is_of_another_world():
    machine = serving()
    found = msgspec.structs.replace(many().state, tick=1)
    assert play(machine, Event("batch/state", found)) == [Ask("world", "world")]
    assert play(machine, world()) == []
    assert published(play(machine, asks(1))) == [1]


def test_it_stops_when_it_is_asked_to():
    assert play(sensing(), STOP) == [Stop()]
    assert play(serving(), STOP) == [Stop()]


def test_rows_become_the_columns_of_a_log():
    machine = serving()
    rows = [effect for tick in (1, 2) for effect in play(machine, asks(tick)) if isinstance(effect, Record)]
    message = chunk("me", 7, rows[0].head, list(zip(*(row.row for row in rows), strict=True)))
    assert (message.run, message.writer, message.seq, message.tick) == ("r", "me", 7, [1, 2])
    assert (message.sonar_model, message.light_model) == ("built-in", "built-in")
    assert message.sonar == [*rows[0].row[1], *rows[1].row[1]]
    assert message.light == [*rows[0].row[2], *rows[1].row[2]]


class Counted:
    """A suite, and the ticks that it was asked."""

    def __init__(self, choice: BuiltInFactory, message: World):
        self.suite, self.ticks = make_suite(choice, message), list[int]()

    def __call__(self, asked: State) -> Any:
        self.ticks.append(asked.tick)
        return self.suite(asked)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.suite, name)


@pytest.mark.parametrize("seed", range(20))
def test_whatever_comes_in_whatever_order_each_tick_is_sensed_once(seed: int):
    draw, suites, newest = random.Random(seed), list[Counted](), {"r": 0, "s": 0}

    def make(message: World) -> Any:
        suites.append(Counted(Remembering() if seed % 2 else BuiltInFactory(), message))
        return suites[-1]

    machine, told = Sensing(make), list[tuple[str, int]]()
    for _ in range(400):
        run = draw.choices(["r", "s"], [9, 1])[0]
        newest[run] += draw.random() < 0.5
        tick = max(newest[run] - draw.choice([0, 0, 0, 1, 3]), 0)
        chunk_of_log = recalled(log(0, newest[run], run=run))
        event = draw.choices([asks(tick, run), world(run), NO_WORLD, chunk_of_log], [12, 3, 1, 3])[0]
        given = answers(play(machine, event))
        told += [(answer.run, answer.tick) for answer in given]
        if event.topic == "state":
            assert told[len(told) - len(given) :] in ([], [(run, tick)])
    assert len(told) > 50
    for suite in suites:
        assert suite.ticks == sorted(set(suite.ticks))


def test_every_transition_is_taken():
    scenarios = [
        test_the_state_that_waits_is_answered_when_its_world_comes,
        test_while_the_world_is_asked_for_the_newest_state_waits,
        test_a_tick_is_answered_again_but_recorded_once,
        test_another_run_is_joined,
        test_without_a_world_the_next_state_asks_again,
        test_a_stray_state_of_another_run_changes_nothing,
        test_states_that_come_while_the_log_is_asked_for_count_as_past,
    ]
    assert_all_taken(TABLE, scenarios)


def test_the_documented_diagram_is_the_table():
    assert diagram(TABLE) in (Path(__file__).parents[2] / "ARCHITECTURE.md").read_text()
