"""A policy that Stable-Baselines3 has learned, in the driver's seat: frozen, and an agent like others."""

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from phototaxis.arena import Arena
from phototaxis.checkpoint import Meta
from phototaxis.errors import UserError
from phototaxis.messages import Readings, World
from phototaxis.options import convert
from phototaxis.seated import SeatedAgent, Step
from phototaxis.task import ACTIONS, MOTORS, BatchObservation, LightHistory, Observation, TaskOptions, action_of

from phototaxis_gym.policy_file import Normalize, load, normalizer, was_normalized
from phototaxis_gym.spaces import observer, rewards

PERCEPTS = ("simple", "rich", "continuous", "sensors")


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
        self.percept = next((name for name in PERCEPTS if observer(name, arena).space == space), "")
        self._discrete = model.action_space == spaces.Discrete(len(ACTIONS))
        if not self.percept or not (self._discrete or model.action_space == spaces.Box(-1.0, 1.0, (2,), np.float32)):
            theirs = f"observes {short(space)} and acts in {model.action_space}"
            raise UserError(f"{file}: {theirs}: not the spaces of an environment of phototaxis{wrapped(space, arena)}")
        self._model, self.file, self._normalize = model, file, normalize
        self._observe, self._dtype = observer(self.percept, arena), space.dtype
        self.hidden: tuple[np.ndarray, ...] | None = None
        """What a recurrent policy remembers of the episode."""

    def motors(self, observation: Observation, history: LightHistory, starts: np.ndarray) -> np.ndarray:
        """(N, 2): the motor commands; `starts` (N,) says whose episode begins."""
        seen = np.asarray(self._observe(observation, history), self._dtype)
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
            raise UserError(f"{source}: its memory does not fit the policy in {self.file}")
        self.hidden = hidden


def short(space: Any) -> str:
    """A space in a few words: the bounds of a long vector are left out."""
    words = str(space)
    return words if len(words) < 80 else f"{type(space).__name__} of the shape {space.shape}"


def wrapped(space: Any, arena: Arena) -> str:
    """Which wrapper may have made these observations from ours; empty when none is known."""
    shape = getattr(space, "shape", None) or ()
    for name in PERCEPTS:
        ours = observer(name, arena).space
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


class PolicyAgent(SeatedAgent):
    """Turns readings into the commands of a frozen policy."""

    def __init__(self, policy: Policy, arena: Arena, max_episode_steps: int):
        percept = "continuous" if policy.percept == "sensors" else policy.percept
        task = convert(TaskOptions, {"percept": percept, "max_episode_steps": max_episode_steps})
        super().__init__(f"policy-{policy.file.stem}", task)
        self.enter(arena)
        self.policy, self._reward = policy, rewards("own", policy.percept)

    def decide(self, readings: Readings, over: bool) -> tuple[Step, tuple[float, float]]:
        """Drive as the policy says, which forgets when an episode begins."""
        episode, policy = self.episode, self.policy
        begins = episode.steps == 0
        if begins:
            policy.hidden = None
        reward = self._reward(episode)
        if over:
            return Step(0, -1, reward, 0.0, 0.0), (0.0, 0.0)
        ((left, right),) = policy.motors(readings, episode.history, np.array([begins])).tolist()
        return Step(0, action_of(left, right), reward, 0.0, 0.0), (left, right)

    def checkpoint(self) -> tuple[Meta, dict[str, np.ndarray]]:
        """Where it is in its episode, for a successor with the same policy; the policy itself is in its file."""
        arrays = {f"hidden_{at}": part for at, part in enumerate(self.policy.hidden or ())}
        meta = self._meta(
            arrays, hyperparameters={}, exploration={}, budget=0, epoch=0, state=(), linked=False, random={}, visits=[]
        )
        return meta, arrays

    def restore(self, meta: Meta, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue where another one with the same policy is; UserError when its memory does not fit."""
        self.policy.remember(arrays, source)
        super().restore(meta, arrays, source)


class PolicyCrowd:
    """Drives N robots through one episode each, all of which begin at the same tick."""

    def __init__(self, policy: Policy):
        self._policy = policy
        self._history: LightHistory | None = None

    def __call__(self, observation: BatchObservation) -> np.ndarray:
        """The motor commands (N, 2) of one tick."""
        count, begins = len(observation.front), self._history is None
        if self._history is None:
            self._history = LightHistory(count)
            self._history.begin(observation.light)
        else:
            self._history.step(observation.light)
        return self._policy.motors(observation, self._history, np.full(count, begins))


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

    def __call__(self, world: World, max_episode_steps: int) -> PolicyAgent:
        return PolicyAgent(self._policy(world.arena), world.arena, max_episode_steps)

    def crowd(self, arena: Arena) -> PolicyCrowd:
        """What drives many robots in an evaluation."""
        return PolicyCrowd(self._policy(arena))

    def _policy(self, arena: Arena) -> Policy:
        return Policy(self._model, self._file, arena, self._normalize)
