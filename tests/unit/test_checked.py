"""A learner that anybody may have written: its numbers are made plain, its faults are one line that names it."""

import itertools
import math
import re
import time
import warnings
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import torch
from making import readings
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import encode
from phototaxis.runtime.errors import ComponentFailed, UserError
from phototaxis.task import BatchObservation, Episode, TaskOptions
from phototaxis.wire.codec import encode as on_the_wire
from phototaxis.wire.messages import AgentLog
from phototaxis_agent import policy as module
from phototaxis_agent.agent import Agent
from phototaxis_agent.batch_agent import BatchAgent
from phototaxis_agent.exploration import Exploration
from phototaxis_agent.learner import Learner, discrete
from phototaxis_agent.learners.qtable import QTable
from phototaxis_agent.policy import Policy
from phototaxis_agent.setup import make_setup
from phototaxis_agent.watchdog import watchdog
from phototaxis_lab.loop import Loop
from phototaxis_lab.measure import evaluate

HERE = Path(__file__).name


class Table(Learner):
    """A small Q-table, which the faulty ones change."""

    class Options(msgspec.Struct, frozen=True):
        rate: float = 0.1

    def __init__(self, options, percept, rng):
        self.allowed, self.rate, self.rng = list(percept.actions), options.rate, rng
        self.q = np.zeros((*discrete(percept).sizes, 9))

    def values(self, state) -> Any:
        return self.q[tuple(map(int, state))][self.allowed].tolist()

    def learn(self, transition) -> Any:
        here = (*map(int, transition.state), transition.action)
        error = transition.reward + 0.7 * max(Table.values(self, transition.next_state)) - self.q[here]
        self.q[here] += self.rate * error
        return float(error)

    def save(self) -> Any:
        return {"q": self.q.copy()}

    def load(self, arrays):
        self.q[:] = arrays["q"]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch):
    """An agent with a learner whose methods are the given ones, called `theirs`."""

    def agent(percept: Any = "simple", learning: bool = True, **methods: Any) -> Agent:
        kind = type("Theirs", (Table,), methods)
        monkeypatch.setattr(module, "find_learner", lambda _: kind)
        task = TaskOptions(percept=percept)
        return Agent(Policy("theirs", None, task, Exploration(), near=0.4, seed=1, budget=100, learning=learning))

    return agent


def drive(agent: Agent, ticks: int = 4) -> Agent:
    agent(readings(0))
    for tick in range(1, ticks):
        agent(readings(tick, left=1.0, right=1.0, author="theirs"))
    return agent


def line(agent: Agent, ticks: int = 4) -> str:
    """The line with which it fails."""
    with pytest.raises(ComponentFailed) as failed:
        drive(agent, ticks)
    text = str(failed.value)
    assert text.startswith("learner theirs: ")
    assert "\n" not in text
    return text


VALUES = {
    "a float64 array": lambda self, state: np.array(Table.values(self, state)),
    "a float32 array": lambda self, state: np.array(Table.values(self, state), np.float32),
    "NumPy's numbers": lambda self, state: [np.float64(one) for one in Table.values(self, state)],
    "whole numbers": lambda self, state: [0] * 9,
    "a tuple": lambda self, state: tuple(Table.values(self, state)),
    "a tensor": lambda self, state: torch.tensor(Table.values(self, state)),
    "a tensor with a gradient": lambda self, state: torch.zeros(9, requires_grad=True),
    "tensors": lambda self, state: [torch.tensor(one) for one in Table.values(self, state)],
}
ERRORS = {
    "float64": lambda self, step: np.float64(Table.learn(self, step)),
    "float32": lambda self, step: np.float32(Table.learn(self, step)),
    "an array": lambda self, step: np.array([Table.learn(self, step)]),
    "a tensor": lambda self, step: torch.tensor(Table.learn(self, step), requires_grad=True),
    "a whole number": lambda self, step: 0 * int(Table.learn(self, step)),
}


@pytest.mark.parametrize("name", VALUES)
def test_numbers_of_other_libraries_are_values(make, name):
    agent = drive(make(values=VALUES[name]))
    assert {type(one) for one in agent.current()} == {float}
    assert len(agent.table()) == 24 * 9


@pytest.mark.parametrize("name", ERRORS)
def test_numbers_of_other_libraries_are_errors_that_can_be_recorded(make, name):
    last = drive(make(learn=ERRORS[name])).last
    assert type(last.td_error) is float
    number, action, reward, error, heat = last
    on_the_wire(AgentLog(
        run="r", seq=0, writer="a", learner="theirs", percept="simple", tick=[3], state=[number], action=[action],
        reward=[reward], td_error=[error], temperature=[heat],
    ))  # fmt: skip


FAULTY_VALUES = {
    "nan": (lambda self, state: [math.nan] * 9, "nan, which is no finite number"),
    "inf": (lambda self, state: [0.0] * 8 + [-math.inf], "-inf, which is no finite number"),
    "too few": (lambda self, state: [0.0] * 3, r"3 numbers; expected 9 numbers \(the percept 'simple' allows 9"),
    "too many": (lambda self, state: np.zeros(11), "11 numbers; expected 9"),
    "a row": (lambda self, state: np.zeros((1, 9)), "1×9 numbers; expected 9"),
    "one": (lambda self, state: 1.0, "one number; expected 9"),
    "none": (lambda self, state: None, "None; expected 9"),
    "words": (lambda self, state: ["a"] * 9, "expected 9 numbers"),
    "ragged": (lambda self, state: [[1.0], [1.0, 2.0]], "expected 9 numbers"),
    "complex": (lambda self, state: np.zeros(9, complex), "expected 9 numbers"),
    "a generator": (lambda self, state: (one for one in range(9)), "expected 9 numbers"),
}


@pytest.mark.parametrize("name", FAULTY_VALUES)
def test_values_that_are_none_name_learner_state_and_step(make, name):
    values, expected = FAULTY_VALUES[name]
    later = itertools.count()
    agent = make(values=lambda self, state: (values if next(later) >= 2 else Table.values)(self, state))
    text = line(agent, 9)
    assert re.search(expected, text), text
    assert text.endswith("; tick 2, learning step 2, state (2, 0, 0, 0)")


class Speechless:
    def __repr__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize(
    "given", [None, math.nan, 1j, "much", [1.0, 2.0], Speechless()], ids=lambda one: type(one).__name__
)
def test_an_error_that_is_no_number_is_told(make, given):
    text = line(make(learn=lambda self, step: given))
    assert "learn() gave" in text
    assert "tick 1, learning step 0, state (2, 0, 0, 0)" in text


def fail(*_: object) -> Any:
    raise KeyError("their\nbug")


def leave(*_: object) -> Any:
    raise SystemExit(0)


class Leaving(BaseException):
    """No `Exception`, as the cancelling errors of some libraries; it cannot even say what it is."""

    def __str__(self) -> str:
        raise RuntimeError


def cancel(*_: object) -> Any:
    raise Leaving


@pytest.mark.parametrize("method", ["values", "learn", "remember"])
def test_what_it_raises_is_told_with_its_file_and_line(make, method):
    text = line(make(**{method: fail}))
    assert f"{method}() raised KeyError: 'their\\nbug' (" in text
    assert f"{HERE}, line {fail.__code__.co_firstlineno + 1})" in text
    assert "state (2, 0, 0, 0)" in text
    assert f"{method}() called sys.exit(0)" in line(make(**{method: leave}))
    assert f"{method}() raised Leaving: <Leaving> ({cancel.__code__.co_filename}, line " in line(
        make(**{method: cancel})
    )


def test_it_fails_before_the_run_when_it_cannot_be_made_or_saved(make):
    def unmade(self, options, percept, rng):
        raise RuntimeError("no device")

    for methods, expected in (
        ({"__init__": unmade}, "its constructor raised RuntimeError: no device"),
        ({"save": lambda self: None}, "save() gave None; expected a dict"),
        ({"save": lambda self: {"q": np.array([{}], dtype=object)}}, "'q' holds Python objects"),
        ({"save": lambda self: {"q": np.zeros(2, [("a", float)])}}, "'q' holds the type"),
        ({"save": lambda self: {"meta": np.zeros(2)}}, "may be called 'meta'"),
        ({"save": lambda self: {3: np.zeros(2)}}, "may be called 3"),
        ({"save": lambda self: {"q": np.broadcast_to(np.zeros(1), 10**9)}}, "bytes, which is too much"),
        ({"save": fail}, "save() raised KeyError"),
        ({"load": fail}, "load() raised KeyError"),
        ({"load": lambda self, arrays: int("x")}, "load() does not take what save() gave: invalid literal"),
        ({"context": property(fail)}, "its context raised KeyError"),
        ({"context": [1.0]}, "its context is [1.0]; expected a tuple"),
        ({"context": (math.nan,)}, "its context gave nan"),
    ):
        with pytest.raises(ComponentFailed, match=r"^learner theirs: ") as failed:
            make(**methods)
        assert expected in str(failed.value)


def test_what_it_says_itself_passes(make):
    with pytest.raises(UserError, match="keeps a table and needs countable states"):
        make(percept="continuous")


def test_lists_and_tensors_are_saved_as_arrays_of_their_own(make):
    agent = make(save=lambda self: {"q": self.q.tolist(), "more": torch.zeros(3, requires_grad=True)})
    saved = agent.learner.save()
    assert {name: array.shape for name, array in saved.items()} == {"q": (3, 2, 2, 2, 9), "more": (3,)}
    live = make(save=lambda self: {"q": self.q})
    before = live.learner.save()["q"]
    drive(live)
    assert not before.any()


def test_a_checkpoint_that_a_fresh_learner_cannot_take_over_is_refused(make):
    def counted(self, step):
        self.q += 1.0
        return 0.0

    agent = drive(make(load=lambda self, arrays: None, learn=counted))
    with pytest.raises(ComponentFailed, match="load\\(\\) does not bring back what save\\(\\) gave"):
        agent.learner.prove(agent.checkpoint()[1])
    whole = drive(make())
    whole.learner.prove(whole.checkpoint()[1])


def test_a_number_that_is_not_finite_is_not_written_as_null(make):
    meta, arrays = drive(make()).checkpoint()
    meta.lights = [(math.nan, 0.0)]
    with pytest.raises(UserError, match="cannot be kept in a checkpoint"):
        encode(meta, arrays)

    class Endless(msgspec.Struct, frozen=True):
        rate: float = math.inf

    with pytest.raises(UserError, match=r"theirs.*rate=inf.*cannot be kept in a checkpoint"):
        make(Options=Endless)


def context(given: Any) -> dict[str, Any]:
    return {
        "context": (0.0,),
        "remember": lambda self, state, action, gain: given,
        "values": lambda self, state: Table.values(self, state[:-1]),
        "learn": lambda self, step: Table.learn(
            self, step._replace(state=step.state[:-1], next_state=step.next_state[:-1])
        ),
    }


@pytest.mark.parametrize("given", [None, (), (1.0, 2.0), [1.0], ("a",), (math.nan,)], ids=str)
def test_a_context_that_is_none_is_told(make, given):
    assert "remember() " in line(make(**context(given)))


def test_a_context_of_numpy_numbers_can_be_kept(make):
    encode(*drive(make(**context((np.float32(0.5),)))).checkpoint())


def test_values_of_many_are_checked_as_those_of_one(make, paper: Arena):
    for methods, expected in (
        ({"values": lambda self, state: [math.nan] * 9}, "values() gave nan"),
        ({"batch_values": lambda self, states: np.zeros(len(states))}, "expected 7×9 numbers"),
        ({"batch_values": lambda self, states: np.full((len(states), 9), math.inf)}, "batch_values() gave inf"),
        ({"batch_values": fail}, "batch_values() raised KeyError"),
        ({**context((np.zeros(3),)), "values": lambda self, state: [0.0] * 9}, "remember() gave 3 numbers"),
    ):
        agent = make(learning=False, **methods)
        with pytest.raises(ComponentFailed, match=r"^learner theirs: .*step [01] of an evaluation") as failed:
            evaluate(paper, agent.policy, 7, 0, max_episode_steps=3)
        assert expected in str(failed.value)


def test_a_learner_cannot_change_the_states_of_a_crowd(make, paper: Arena):
    def careless(self, states):
        states[:] = 5.0
        return np.zeros((len(states), 9))

    agent = make(learning=False, batch_values=careless)
    batch = BatchAgent(agent.policy, 0.4, 3, 0)
    evaluate(paper, agent.policy, 3, 0, max_episode_steps=2)
    dark, free = np.zeros(3), np.zeros(3, bool)
    episode = Episode(100, 3)
    episode.begin(BatchObservation(np.full((16, 3), 5.0), np.stack([dark, dark]), free, free))
    batch(episode)
    assert not (batch._state == 5.0).any()


def test_a_recorded_run_is_the_run_of_a_learner_that_draws_when_asked(make, paper: Arena):
    def noisy(self, state):
        return [one + 0.01 * self.rng.random() for one in Table.values(self, state)]

    hashes = []
    for watched_too in (False, True):
        loop = Loop(paper, make(values=noisy), 1, 60)
        while not loop.simulation.finished:
            loop.step()
            if watched_too:
                loop.agent.table()
                loop.agent.current()
                loop.agent.checkpoint()
        hashes.append(loop.simulation.state.hash)
    assert hashes[0] == hashes[1]


def test_a_learner_that_does_not_return_is_named(make, capfd: pytest.CaptureFixture[str]):
    said = ""

    def slow(self, step):
        nonlocal said
        deadline = time.monotonic() + 20
        while "has not returned" not in said and time.monotonic() < deadline:
            said += capfd.readouterr().err
            time.sleep(0.01)
        return 0.0

    with watchdog(0.05):
        drive(make(learn=slow), 2)
    assert said.startswith("phototaxis: warning: learner theirs: learn() has not returned for 0.05 s (")
    assert HERE in said


def test_a_constructor_that_does_not_return_is_named(monkeypatch, capfd: pytest.CaptureFixture[str]):
    said = ""

    def slow(self, options, percept, rng):
        nonlocal said
        deadline = time.monotonic() + 20
        while "has not returned" not in said and time.monotonic() < deadline:
            said += capfd.readouterr().err
            time.sleep(0.01)
        QTable.__init__(self, options, percept, rng)

    setup = make_setup()
    monkeypatch.setattr(module, "find_learner", lambda _: type("Theirs", (QTable,), {"__init__": slow}))
    monkeypatch.setattr("phototaxis_agent.setup.watchdog", lambda: watchdog(0.05))
    setup.check()
    assert "learner qtable: __init__() has not returned" in said


def test_the_process_of_whoever_embeds_a_learner_is_left_as_it_is(paper: Arena):
    from phototaxis.wire.messages import World
    from phototaxis_agent.setup import make_setup

    threads, drawn = torch.get_num_threads(), torch.random.get_rng_state()
    numbers = np.random.get_state(legacy=False)["state"]
    torch.set_num_threads(3)
    try:
        with warnings.catch_warnings(record=True) as warned:
            for name in ("ann", "ann-per-action", "elman", "dqn"):
                loop = Loop(paper, make_setup(name).agent(World(run="r", arena=paper, seed=0, epochs=5)), 0, 5)
                while not loop.simulation.finished:
                    loop.step()
                loop.agent.table()
        assert torch.get_num_threads() == 3
        assert torch.equal(torch.random.get_rng_state(), drawn)
        assert str(np.random.get_state(legacy=False)["state"]) == str(numbers)
        assert not warned
    finally:
        torch.set_num_threads(threads)
