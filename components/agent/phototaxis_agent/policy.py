"""Chooses actions and learns, for one robot or for many that share the policy."""

import math
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import msgspec
import numpy as np
from phototaxis.runtime.checkpoint import CheckpointMetadata
from phototaxis.runtime.errors import ComponentFailed, UserError
from phototaxis.task import ACTIONS, PERCEPTS, LightHistory, Observation, PerceptState, TaskOptions, state_number

from phototaxis_agent.checked import CheckedLearner
from phototaxis_agent.exploration import Exploration, draw
from phototaxis_agent.generator import load_state, saved_state
from phototaxis_agent.learner import Learner, Transition, find_learner


class Policy:
    """Percept, learner, exploration and the generator of all randomness.

    Parameters
    ----------
    learner : name of a learner.
    options : its hyperparameters, an instance of its `Options`; None for the defaults.
    task, exploration : what is learned, and how actions are drawn.
    near : obstacle threshold of the arena, m.
    seed : of all randomness.
    budget : learning steps that falling rates and temperatures are spread over.
    learning : False freezes the values, and the temperature is then the final one.

    Attributes
    ----------
    epoch : learning steps so far.
    visits : how often each state of the percept was met; empty where states are real numbers.
    tick : the tick that is being answered, for a line about what went wrong in it; −1 before the first.
    shared : whether it drives several robots; no transition then continues the one before.
    """

    def __init__(
        self,
        learner: str,
        options: Any,
        task: TaskOptions,
        exploration: Exploration,
        *,
        near: float,
        seed: int,
        budget: int,
        learning: bool = True,
    ):
        kind: type[Learner] = find_learner(learner)
        self.name, self.task, self.exploration = learner, task, exploration
        self.near, self.budget, self.learning = near, budget, learning
        self.percept = PERCEPTS[task.percept]
        self.epoch, self.tick, self.shared = 0, -1, False
        self.visits = [0] * math.prod(self.percept.sizes)
        self._options = _repeatable(learner, kind.Options() if options is None else options)
        self._rng = np.random.default_rng((seed, 0xA6E47))
        self.learner = CheckedLearner(learner, kind, self._options, self.percept, self._rng, self._where)

    def perceive(self, observation: Observation, history: LightHistory) -> tuple[PerceptState, int]:
        """The percept's state and its number, counted as met; the number is 0 where states are real numbers."""
        state = self.percept.state(observation, history, self.near)
        if not self.visits:
            return state, 0
        number = state_number(self.percept, state)
        self.visits[number] += 1
        return state, number

    def learn(
        self, state: PerceptState, action: int, reward: float, following: PerceptState, terminated: bool, first: bool
    ) -> float:
        """Learn from one transition, with the fields of `Transition`; the temporal-difference error."""
        progress = min(self.epoch / self.budget, 1.0)
        error = self.learner.learn(Transition(state, action, reward, following, terminated, progress, first))
        self.epoch += 1
        return error

    def choose(self, state: PerceptState, temperature: float) -> int:
        """An action, drawn by equation 2: an index into `ACTIONS`."""
        return self.percept.actions[draw(self.learner.values(state), temperature, self._rng.random())]

    @property
    def temperature(self) -> float:
        """T of equation 2 at the present epoch."""
        exploration = self.exploration
        return exploration.temperature(self.epoch, self.budget) if self.learning else exploration.temperature_end

    def table(self) -> list[float]:
        """Q of every state and action, flattened row by row, 9 a row; 0 where an action is not allowed."""
        rows = np.zeros((len(self.visits), len(ACTIONS)))
        allowed = list(self.percept.actions)
        with self._aside():
            for number, state in enumerate(np.ndindex(*self.percept.sizes)):
                rows[number, allowed] = self.learner.values((*state, *self.learner.context))
        return rows.ravel().tolist()

    def row(self, state: PerceptState) -> list[float]:
        """Q of a state for each of the 9 actions; 0 where an action is not allowed."""
        row = [0.0] * len(ACTIONS)
        with self._aside():
            values = self.learner.values(state)
        for action, value in zip(self.percept.actions, values, strict=True):
            row[action] = float(value)
        return row

    def save(self) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """The fields of a checkpoint's `CheckpointMetadata` that tell of the policy, and the learner's arrays."""
        with self._aside():
            arrays = self.learner.save()
        fields = {
            "hyperparameters": msgspec.to_builtins(self._options),
            "exploration": msgspec.to_builtins(self.exploration),
            "budget": self.budget,
            "epoch": self.epoch,
            "random": saved_state(self._rng),
            "visits": list(self.visits),
        }
        return fields, arrays

    def take_over(self, meta: CheckpointMetadata, arrays: dict[str, np.ndarray], source: str) -> None:
        """Take over what was learned, and nothing else.

        Raises
        ------
        UserError
            when the checkpoint is of another learner or percept; `source` names it.
        ComponentFailed
            when the learner fails to load what it saved.
        """
        for what, ours, theirs in (
            ("learner", self.name, meta.learner),
            ("percept", self.task.percept, meta.percept),
        ):
            if ours != theirs:
                raise UserError(f"{source}: a checkpoint of the {what} '{theirs}', but '{ours}' is asked for")
        try:
            self.learner.load(arrays)
        except ValueError as error:
            raise UserError(f"{source}: does not fit the {self.name} learner: {error}") from None
        except ComponentFailed as error:
            raise ComponentFailed(f"{source}: {error}") from error

    def restore(self, meta: CheckpointMetadata, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue from a checkpoint, bit for bit; the errors are those of `take_over`."""
        self.take_over(meta, arrays, source)
        try:
            load_state(self._rng, meta.random)
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(f"{source}: does not fit the {self.name} learner: {error}") from None
        self.visits[:] = meta.visits
        self.epoch, self.budget = meta.epoch, max(meta.budget, self.budget)

    @contextmanager
    def _aside(self) -> Generator[None]:
        """Call the learner without an influence on the run: the random generator is reset afterwards."""
        drawn = self._rng.bit_generator.state
        yield
        self._rng.bit_generator.state = drawn

    def _where(self) -> str:
        """Which step it is, for a line about what went wrong in it."""
        return f"tick {self.tick}, learning step {self.epoch}" if self.tick >= 0 else ""


def _repeatable(learner: str, options: Any) -> Any:
    """The options, if a checkpoint can hold them, so that what was learned can be loaded again."""
    try:
        kept = msgspec.json.decode(msgspec.json.encode(options), type=type(options))
    except (msgspec.MsgspecError, TypeError, ValueError) as error:
        raise UserError(f"learner {learner}: {options} cannot be kept in a checkpoint: {error}") from None
    if kept != options:
        raise UserError(f"learner {learner}: {options} would be {kept} when read from a checkpoint")
    return options
