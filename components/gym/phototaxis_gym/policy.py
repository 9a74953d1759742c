"""A policy that Stable-Baselines3 has learned, in the driver's seat: frozen, and an agent like others."""

from pathlib import Path
from typing import Any, Self

import numpy as np
from gymnasium import spaces
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import CheckpointMetadata
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import convert
from phototaxis.runtime.seated import SeatedAgent, Step
from phototaxis.task import ACTIONS, MOTORS, Episode, TaskOptions, action_of
from phototaxis.wire.messages import Readings, World

from phototaxis_gym.policy_file import Normalize, load, normalizer, was_normalized
from phototaxis_gym.spaces import observer, rewards

OBSERVATIONS = ("simple", "rich", "continuous", "sensors")

Hidden = tuple[np.ndarray, ...] | None
"""What a recurrent policy remembers of the episodes of the robots that it drives together; None for nothing yet."""


class FrozenPolicy:
    """A frozen policy for N robots: from what they sense to their motor commands, as it was trained.

    Which percept and which actions it has follows from the model's spaces. It may drive any number of robots: what a
    recurrent policy remembers of them is kept by its caller.

    Raises
    ------
    UserError
        when the spaces are none of ours.
    """

    def __init__(self, model: Any, file: Path, arena: Arena, normalize: Normalize | None = None):
        space = model.observation_space
        self.percept = next((name for name in OBSERVATIONS if observer(name, arena).space == space), "")
        self._discrete = model.action_space == spaces.Discrete(len(ACTIONS))
        if not self.percept or not (self._discrete or model.action_space == spaces.Box(-1.0, 1.0, (2,), np.float32)):
            theirs = f"observes {short(space)} and acts in {model.action_space}"
            raise UserError(f"{file}: {theirs}: not the spaces of an environment of phototaxis{wrapped(space, arena)}")
        self._model, self.file, self._normalize = model, file, normalize
        self._observe, self._dtype = observer(self.percept, arena), space.dtype

    def motors(self, episode: Episode, hidden: Hidden) -> tuple[np.ndarray, Hidden]:
        """The motor commands (N, 2) after the newest observation of N robots, and what is remembered from now on."""
        starts = np.atleast_1d(episode.steps == 0)
        seen = np.asarray(self._observe(episode.now, episode.history), self._dtype)
        seen = seen.reshape(len(starts), *self._model.observation_space.shape)
        if self._normalize is not None:
            seen = self._normalize(seen)
        chosen, hidden = self._model.predict(seen, hidden, episode_start=starts, deterministic=True)
        return MOTORS[chosen] if self._discrete else np.asarray(chosen, float), hidden

    def stored(self, arrays: dict[str, np.ndarray], source: str) -> Hidden:
        """What the arrays of a checkpoint remember of one robot's episode.

        Raises
        ------
        UserError
            when it has another shape than this policy's; `source` names the checkpoint.
        """
        hidden = tuple(arrays[name] for name in sorted(arrays)) or None
        shape = getattr(self._model.policy, "lstm_hidden_state_shape", None)
        if hidden and any(part.shape != tuple(shape or ()) for part in hidden):
            raise UserError(f"{source}: its memory does not fit the policy in {self.file}")
        return hidden


def short(space: Any) -> str:
    """A space in a few words: the bounds of a long vector are left out."""
    words = str(space)
    return words if len(words) < 80 else f"{type(space).__name__} of the shape {space.shape}"


def wrapped(space: Any, arena: Arena) -> str:
    """Which wrapper may have made these observations from ours; empty when none is known."""
    shape = getattr(space, "shape", None) or ()
    for name in OBSERVATIONS:
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

    def __init__(self, policy: FrozenPolicy, max_episode_steps: int):
        percept = "continuous" if policy.percept == "sensors" else policy.percept
        task = convert(TaskOptions, {"percept": percept, "max_episode_steps": max_episode_steps})
        super().__init__(f"policy-{policy.file.stem}", task)
        self.policy, self._reward = policy, rewards("own", policy.percept)
        self.hidden: Hidden = None

    def decide(self, readings: Readings, over: bool) -> tuple[Step, tuple[float, float]]:
        """Drive as the policy says."""
        reward = self._reward(self.episode)
        if over:
            return Step(0, -1, reward, 0.0, 0.0), (0.0, 0.0)
        motors, self.hidden = self.policy.motors(self.episode, self.hidden)
        ((left, right),) = motors.tolist()
        return Step(0, action_of(left, right), reward, 0.0, 0.0), (left, right)

    def another(self) -> Self:
        return type(self)(self.policy, self.task.max_episode_steps)

    def checkpoint(self) -> tuple[CheckpointMetadata, dict[str, np.ndarray]]:
        """Where it is in its episode, for a successor with the same policy; the policy itself is in its file."""
        arrays = {f"hidden_{at}": part for at, part in enumerate(self.hidden or ())}
        meta = self._meta(
            arrays, hyperparameters={}, exploration={}, budget=0, epoch=0, state=(), linked=False, random={}, visits=[]
        )
        return meta, arrays

    def restore(self, meta: CheckpointMetadata, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue where another one with the same policy is; UserError when its memory does not fit."""
        self.hidden = self.policy.stored(arrays, source)
        super().restore(meta, arrays, source)


class BatchPolicyAgent:
    """Drives N robots through an evaluation."""

    def __init__(self, policy: FrozenPolicy):
        self._policy = policy
        self._hidden: Hidden = None

    def __call__(self, episode: Episode) -> np.ndarray:
        """The motor commands (N, 2) of one tick."""
        motors, self._hidden = self._policy.motors(episode, self._hidden)
        return motors


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
        agent = PolicyAgent(self._policy(world.arena), max_episode_steps)
        agent.enter(world.arena)
        return agent

    def batch(self, arena: Arena) -> BatchPolicyAgent:
        """What drives many robots in an evaluation."""
        return BatchPolicyAgent(self._policy(arena))

    def _policy(self, arena: Arena) -> FrozenPolicy:
        return FrozenPolicy(self._model, self._file, arena, self._normalize)
