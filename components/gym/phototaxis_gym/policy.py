"""A policy that Stable-Baselines3 has learned, in the driver's seat: frozen, and an agent like others."""

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from phototaxis.arena import Arena
from phototaxis.checkpoint import Meta, learner_hash
from phototaxis.errors import UserError
from phototaxis.messages import Command, End, Readings, World
from phototaxis.options import convert
from phototaxis.task import ACTIONS, CrowdReadings, Memory, TaskOptions, lit

from phototaxis_gym.policy_file import Normalize, load, normalizer, was_normalized
from phototaxis_gym.spaces import MOTORS, observation, rewards

PERCEPTS = ("simple", "rich", "continuous", "sensors")
_INDEX = {motors: index for index, motors in enumerate(ACTIONS)}


class Policy:
    """A frozen policy for N robots: from what they sense to their motor commands, as it was trained.

    Which percept and which actions it has follows from the model's spaces. What a recurrent policy remembers is begun
    anew with each robot's episode.

    Raises
    ------
    UserError
        when the spaces are none of ours.
    """

    def __init__(self, model: Any, file: Path, arena: Arena, normalize: Normalize | None = None):
        space = model.observation_space
        self.percept = next((name for name in PERCEPTS if observation(name, arena).space == space), "")
        self._discrete = model.action_space == spaces.Discrete(len(ACTIONS))
        if not self.percept or not (self._discrete or model.action_space == spaces.Box(-1.0, 1.0, (2,), np.float32)):
            theirs = f"observes {short(space)} and acts in {model.action_space}"
            raise UserError(f"{file}: {theirs}: not the spaces of an environment of phototaxis{wrapped(space, arena)}")
        self._model, self._file, self._normalize = model, file, normalize
        self._observe, self._dtype = observation(self.percept, arena), space.dtype
        self.hidden: tuple[np.ndarray, ...] | None = None
        """What a recurrent policy remembers of the episode."""

    def motors(self, senses: Any, history: Memory, starts: np.ndarray) -> np.ndarray:
        """(N, 2): the motor commands; `starts` (N,) says whose episode begins."""
        seen = np.asarray(self._observe(senses, history), self._dtype)
        seen = seen.reshape(len(starts), *self._model.observation_space.shape)
        if self._normalize is not None:
            seen = self._normalize(seen)
        chosen, self.hidden = self._model.predict(seen, self.hidden, episode_start=starts, deterministic=True)
        return MOTORS[chosen] if self._discrete else np.asarray(chosen, float)

    def remember(self, arrays: dict[str, np.ndarray], source: str) -> None:
        """Take over the memory of another one with the same policy.

        Raises
        ------
        UserError
            when it has another shape; `source` names it.
        """
        hidden = tuple(arrays[name] for name in sorted(arrays)) or None
        shape = getattr(self._model.policy, "lstm_hidden_state_shape", None)
        if hidden and any(part.shape != tuple(shape or ()) for part in hidden):
            raise UserError(f"{source}: its memory does not fit the policy in {self._file}")
        self.hidden = hidden


def short(space: Any) -> str:
    """A space in a few words: the bounds of a long vector are left out."""
    words = str(space)
    return words if len(words) < 80 else f"{type(space).__name__} of the shape {space.shape}"


def wrapped(space: Any, arena: Arena) -> str:
    """Which wrapper may have made these observations from ours; empty when none is known."""
    shape = getattr(space, "shape", None) or ()
    for name in PERCEPTS:
        ours = observation(name, arena).space
        if not isinstance(ours, spaces.Box) or not isinstance(space, spaces.Box) or not shape:
            continue
        count = int(np.prod(shape))
        (size,) = ours.shape
        stacks = shape[-1] % size == 0 and count > size
        if stacks and np.array_equal(np.sort(space.high, axis=None), np.sort(np.tile(ours.high, count // size))):
            return f" ({count // size} frames of {name} stacked? policies of stacked frames are not supported)"
        if shape == ours.shape and not np.isfinite(space.high).all():
            return f" ({name} through NormalizeObservation? train through VecNormalize, whose statistics can be saved)"
    return ""


class PolicyAgent(Policy):
    """Turns readings into the commands of a frozen policy; has what the agent's process asks of an `Agent`."""

    def __init__(self, model: Any, file: Path, world: World, cap: int, normalize: Normalize | None = None):
        self.name = self.author = f"policy-{file.stem}"
        super().__init__(model, file, world.arena, normalize)
        self.enter(world.arena)
        self._cap = cap
        percept = self.percept
        self._reward = rewards("own", percept)
        self.task = convert(TaskOptions, {"percept": "continuous" if percept == "sensors" else percept, "cap": cap})
        self._memory = Memory()
        self._run, self._tick, self._episode, self._steps = "", -1, -1, 0
        self.command: Command | None = None
        self.visits: list[int] = []
        self.last = (0, -1, 0.0, 0.0, 0.0)

    def enter(self, arena: Arena) -> None:
        """Go on in an arena."""
        self.arena, self.arena_digest = arena.name, arena.digest

    def __call__(self, readings: Readings) -> Command:
        """Answer one tick."""
        if readings.run != self._run or readings.episode != self._episode or readings.tick != self._tick + 1:
            self._memory.clear()
            self.hidden = None
            self._run, self._episode, self._steps = readings.run, readings.episode, -1
        self._tick, self._steps = readings.tick, self._steps + 1
        memory = self._memory
        memory.see(readings)
        reward = self._reward(max(memory.before), readings, memory.unchanged) if self._steps else 0.0
        end: End = "reached" if lit(readings) else "cap" if self._steps >= self._cap else ""
        action, left, right = -1, 0.0, 0.0
        if not end:
            ((left, right),) = self.motors(readings, memory, np.array([self._steps == 0])).tolist()
            action = _INDEX.get((left, right), -1)
        self.last = (0, action, reward, 0.0, 0.0)
        self.command = Command(
            run=readings.run, tick=readings.tick, author=self.author, left=left, right=right, end=end
        )
        return self.command

    @property
    def tick(self) -> tuple[str, int]:
        """Run and tick of the last answer."""
        return self._run, self._tick

    def table(self) -> list[float]:
        """Nothing: a policy has no values."""
        return []

    def current(self) -> list[float]:
        """Nothing: a policy has no values."""
        return []

    def checkpoint(self) -> tuple[Meta, dict[str, np.ndarray]]:
        """Where it is in its episode, for a successor with the same policy; the policy itself is in its file."""
        command, arrays = self.command, {f"hidden_{at}": part for at, part in enumerate(self.hidden or ())}
        meta = Meta(
            learner=self.name, percept=self.task.percept, reward="own", cap=self._cap, hyperparameters={},
            exploration={}, budget=0, run=self._run, tick=self._tick, episode=self._episode, epoch=0, steps=self._steps,
            lights=list(self._memory.lights), state=(), linked=False,
            answer=None if command is None else (command.left, command.right, command.end),
            random={}, visits=[], arena=self.arena, arena_digest=self.arena_digest,
            learner_hash=learner_hash(arrays),
        )  # fmt: skip
        return meta, arrays

    def restore(self, meta: Meta, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue where another one with the same policy is."""
        self.remember(arrays, source)
        self._run, self._tick, self._episode, self._steps = meta.run, meta.tick, meta.episode, meta.steps
        self._memory.clear()
        self._memory.lights.extend(meta.lights)
        self.command = None
        if meta.answer is not None:
            left, right, end = meta.answer
            self.command = Command(run=meta.run, tick=meta.tick, author=self.author, left=left, right=right, end=end)


class PolicyCrowd(Policy):
    """Drives N robots through one episode each, all of which begin at the same tick."""

    def __init__(self, model: Any, file: Path, arena: Arena, normalize: Normalize | None = None):
        super().__init__(model, file, arena, normalize)
        self._memory = Memory()

    def __call__(self, readings: CrowdReadings) -> np.ndarray:
        """The motor commands (N, 2) of one tick."""
        starts = np.full(len(readings.front), not self._memory.lights)
        self._memory.see(readings)
        return self.motors(readings, self._memory, starts)


class PolicyFile:
    """Loads a policy at once, with the statistics of its observations, and makes agents of it.

    Raises
    ------
    UserError
        when a file cannot be loaded, or the policy was trained through VecNormalize and `normalize` is None.
    """

    def __init__(self, file: Path, trusted: bool, normalize: Path | None = None):
        self._file, self._model = file, load(file, trusted)
        if normalize is None and was_normalized(self._model):
            raise UserError(
                f"{file}: it was trained through VecNormalize and needs its statistics; give the file that "
                f"VecNormalize.save has written: --normalize FILE.pkl (or none, if it normalised rewards only)"
            )
        self._normalize = None if normalize is None else normalizer(normalize, trusted, self._model)

    def __call__(self, world: World, cap: int) -> PolicyAgent:
        if world.robots > 1:
            raise UserError(f"{self._file}: a policy drives one robot; this world has {world.robots}")
        return PolicyAgent(self._model, self._file, world, cap, self._normalize)

    def crowd(self, arena: Arena) -> PolicyCrowd:
        """What drives many robots in an evaluation."""
        return PolicyCrowd(self._model, self._file, arena, self._normalize)
