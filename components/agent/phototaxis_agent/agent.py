"""The action-perception loop around a learner (section 5.1 and figure 7 of the paper)."""

import math
from collections.abc import Generator
from contextlib import contextmanager
from operator import mul
from typing import Any, NamedTuple

import msgspec
import numpy as np
from phototaxis.arena import Arena
from phototaxis.checkpoint import Meta, learner_hash
from phototaxis.errors import ComponentFailed, UserError
from phototaxis.messages import Command, End, Readings
from phototaxis.task import ACTIONS, PERCEPTS, Memory, State, TaskOptions, lit

from phototaxis_agent.checked import CheckedLearner
from phototaxis_agent.exploration import Exploration, draw
from phototaxis_agent.learner import Learner, Transition, find

_INDEX = {motors: index for index, motors in enumerate(ACTIONS)}


class Step(NamedTuple):
    """What one tick was for the agent: for the recording, not for control."""

    percept: int
    action: int
    reward: float
    td_error: float
    temperature: float


class Agent:
    """Turns readings into commands and learns from what they led to.

    Parameters
    ----------
    learner : name of a learner.
    options : its hyperparameters, an instance of its `Options`; None for the defaults.
    task, exploration : what is learned and how actions are drawn.
    near : obstacle threshold of the arena, m.
    seed : of all the agent's randomness.
    arena : where it learns, which its checkpoints tell.
    budget : learning steps that falling rates and temperatures are spread over.
    learning : False freezes the policy (the temperature is then the final one).

    The action that is learned from is the one that the readings say was applied, whoever chose it, so
    that an agent may also learn from another's driving; a command that is not one of the nine breaks
    the chain and nothing is learned from that step.
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
        arena: Arena | None = None,
    ):
        kind: type[Learner] = find(learner)
        self.name, self.author = learner, learner
        self.arena = self.arena_digest = ""
        self.task, self.exploration, self.budget = task, exploration, budget
        self.percept = PERCEPTS[task.percept]
        self.learning = learning
        self.alone = True
        self.epoch = 0
        self.last = Step(0, -1, 0.0, 0.0, 0.0)
        self._options = _repeatable(learner, kind.Options() if options is None else options)
        self._rng = np.random.default_rng((seed, 0xA6E47))
        self._reward = task.scheme()
        self._near = near
        if arena is not None:
            self.enter(arena)
        self._memory = Memory()
        self._strides = _strides(self.percept.sizes)
        self.visits = [0] * math.prod(self.percept.sizes)
        self._run, self._tick, self._episode, self._steps = "", -1, -1, 0
        self.learner = CheckedLearner(learner, kind, self._options, self.percept, self._rng, self._where)
        self._state: State | None = None
        self._linked = False
        self.command: Command | None = None
        """The answer to the last tick."""

    def enter(self, arena: Arena) -> None:
        """Go on in an arena."""
        self.arena, self.arena_digest, self._near = arena.name, arena.digest, arena.sensing.near

    def __call__(self, readings: Readings) -> Command:
        """Answer one tick: perceive, learn from the last action, choose the next."""
        if readings.run != self._run or readings.episode != self._episode or readings.tick != self._tick + 1:
            self._memory.clear()
            self._state, self._steps, self._linked = None, 0, False
            self._run, self._episode = readings.run, readings.episode
        self._tick = readings.tick
        memory, before = self._memory, self._state
        memory.see(readings)
        state = self.percept.state(readings, memory, self._near)
        number = self._visit(state)
        done = lit(readings)
        reward = error = 0.0
        if before is None:
            state += self.learner.context
        else:
            self._steps += 1
            reward = self._reward(max(memory.before), readings, memory.unchanged)
            applied = _INDEX.get((readings.left, readings.right), -1) if readings.author else -1
            state += self.learner.remember(before, applied, max(readings.light) - max(memory.before))
            if self.learning and applied >= 0:
                progress = min(self.epoch / self.budget, 1.0)
                first, self._linked = not (self._linked and self.alone), True
                error = self.learner.learn(Transition(before, applied, reward, state, done, progress, first))
                self.epoch += 1
            else:
                self._linked = False
        self._state = state
        temperature = self.exploration.temperature(self.epoch, self.budget) if self.learning else self.exploration.cold
        end: End = "reached" if done else "cap" if self._steps >= self.task.cap else ""
        action, (left, right) = -1, (0.0, 0.0)
        if not end:
            action = self.percept.actions[draw(self.learner.values(state), temperature, self._rng.random())]
            left, right = ACTIONS[action]
        self.last = Step(number, action, reward, error, temperature)
        self.command = Command(
            run=readings.run, tick=readings.tick, author=self.author, left=left, right=right, end=end
        )
        return self.command

    def _where(self) -> str:
        """Which step it is, for a line about what went wrong in it."""
        return f"tick {self._tick}, learning step {self.epoch}" if self._run else ""

    def _visit(self, state: State) -> int:
        """The number of a percept's state, counted as met; 0 where states are real numbers."""
        if not self.visits:
            return 0
        number = int(sum(map(mul, state, self._strides)))
        self.visits[number] += 1
        return number

    def table(self) -> list[float]:
        """Q of every state and action, flattened row by row, 9 a row; 0 where an action is not allowed."""
        rows = np.zeros((len(self.visits), len(ACTIONS)))
        allowed = list(self.percept.actions)
        with self._aside():
            for number, state in enumerate(np.ndindex(*self.percept.sizes)):
                rows[number, allowed] = self.learner.values((*state, *self.learner.context))
        return rows.ravel().tolist()

    def current(self) -> list[float]:
        """Q of the present percept for each of the 9 actions; 0 where an action is not allowed."""
        row = [0.0] * len(ACTIONS)
        if self._state is not None:
            with self._aside():
                values = self.learner.values(self._state)
            for action, value in zip(self.percept.actions, values, strict=True):
                row[action] = float(value)
        return row

    @contextmanager
    def _aside(self) -> Generator[None]:
        """Ask the learner something without an influence on the run: what it draws meanwhile is drawn again."""
        drawn = self._rng.bit_generator.state
        yield
        self._rng.bit_generator.state = drawn

    def checkpoint(self) -> tuple[Meta, dict[str, np.ndarray]]:
        """Everything needed to continue bit for bit."""
        with self._aside():
            arrays = self.learner.save()
        digest, command = learner_hash(arrays), self.command
        meta = Meta(
            learner=self.name,
            percept=self.task.percept,
            reward=self.task.reward,
            cap=self.task.cap,
            hyperparameters=msgspec.to_builtins(self._options),
            exploration=msgspec.to_builtins(self.exploration),
            budget=self.budget,
            run=self._run,
            tick=self._tick,
            episode=self._episode,
            epoch=self.epoch,
            steps=self._steps,
            lights=list(self._memory.lights),
            state=self._state or (),
            linked=self._linked,
            answer=None if command is None else (command.left, command.right, command.end),
            random=_map_numbers(str, self._rng.bit_generator.state),
            visits=list(self.visits),
            arena=self.arena,
            arena_digest=self.arena_digest,
            learner_hash=digest,
        )
        return meta, arrays

    def take_over(self, meta: Meta, arrays: dict[str, np.ndarray], source: str) -> None:
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

    def restore(self, meta: Meta, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue from a checkpoint, bit for bit; in another run the percept's history does not count.

        Raises
        ------
        UserError, ComponentFailed
            as in `take_over`.
        """
        self.take_over(meta, arrays, source)
        try:
            self._rng.bit_generator.state = _map_numbers(_number, meta.random)
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(f"{source}: does not fit the {self.name} learner: {error}") from None
        self.visits = list(meta.visits)
        self.epoch, self.budget = meta.epoch, max(meta.budget, self.budget)
        self._run, self._tick, self._episode, self._steps = meta.run, meta.tick, meta.episode, meta.steps
        self._memory.clear()
        self._memory.lights.extend(meta.lights)
        self._state, self._linked = meta.state or None, meta.linked
        self.command = None
        if meta.answer is not None:
            left, right, end = meta.answer
            self.command = Command(run=meta.run, tick=meta.tick, author=self.author, left=left, right=right, end=end)

    @property
    def tick(self) -> tuple[str, int]:
        """Run and tick of the last answer."""
        return self._run, self._tick


def _repeatable(learner: str, options: Any) -> Any:
    """The options, if a checkpoint can hold them, so that what was learned can be loaded again."""
    try:
        kept = msgspec.json.decode(msgspec.json.encode(options), type=type(options))
    except (msgspec.MsgspecError, TypeError, ValueError) as error:
        raise UserError(f"learner {learner}: {options} cannot be kept in a checkpoint: {error}") from None
    if kept != options:
        raise UserError(f"learner {learner}: {options} would be {kept} when read from a checkpoint")
    return options


def _strides(sizes: tuple[int, ...]) -> list[int]:
    """Weights that turn a state into its number."""
    return [math.prod(sizes[i + 1 :]) for i in range(len(sizes))]


def _map_numbers(change: Any, value: Any) -> Any:
    """A random generator's state with its numbers as text, or back: they exceed 64 bits."""
    if isinstance(value, dict):
        return {key: _map_numbers(change, item) for key, item in value.items()}
    return change(value) if isinstance(value, (int, str)) and not isinstance(value, bool) else value


def _number(text: Any) -> Any:
    return int(text) if isinstance(text, str) and text.lstrip("-").isdigit() else text
