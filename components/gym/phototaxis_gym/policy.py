"""Makes agents of frozen policies that Stable-Baselines3 has learned."""

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
"""The hidden state of a recurrent policy for all robots that it drives; None at first, and for other policies."""


class FrozenPolicy:
    """Maps the observations of N robots to motor commands, with a policy that no longer learns.

    The model's spaces tell its percept and its actions. It can drive any number of robots, because the caller keeps
    the hidden state of a recurrent policy.

    Raises
    ------
    UserError
        when the model's spaces are not those of one of our environments.
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
        """Return the motor commands (N, 2) after the newest observation of N robots, and the new hidden state."""
        starts = np.atleast_1d(episode.steps == 0)
        seen = np.asarray(self._observe(episode.now, episode.history), self._dtype)
        seen = seen.reshape(len(starts), *self._model.observation_space.shape)
        if self._normalize is not None:
            seen = self._normalize(seen)
        chosen, hidden = self._model.predict(seen, hidden, episode_start=starts, deterministic=True)
        return MOTORS[chosen] if self._discrete else np.asarray(chosen, float), hidden

    def stored(self, arrays: dict[str, np.ndarray], source: str) -> Hidden:
        """Return the hidden state in the arrays of a checkpoint.

        Raises
        ------
        UserError
            when its shape does not fit this policy; `source` names the checkpoint.
        """
        hidden = tuple(arrays[name] for name in sorted(arrays)) or None
        shape = getattr(self._model.policy, "lstm_hidden_state_shape", None)
        if hidden and any(part.shape != tuple(shape or ()) for part in hidden):
            raise UserError(f"{source}: its hidden state does not fit the policy in {self.file}")
        return hidden


def short(space: Any) -> str:
    """Describe a space briefly, without the bounds of a long vector."""
    words = str(space)
    return words if len(words) < 80 else f"{type(space).__name__} of the shape {space.shape}"


def wrapped(space: Any, arena: Arena) -> str:
    """Guess which wrapper changed our observations into these, as a remark for an error; "" if none is known."""
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
        """Choose the motor commands with the policy."""
        reward = self._reward(self.episode)
        if over:
            return Step(0, -1, reward, 0.0, 0.0), (0.0, 0.0)
        motors, self.hidden = self.policy.motors(self.episode, self.hidden)
        ((left, right),) = motors.tolist()
        return Step(0, action_of(left, right), reward, 0.0, 0.0), (left, right)

    def another(self) -> Self:
        return type(self)(self.policy, self.task.max_episode_steps)

    def checkpoint(self) -> tuple[CheckpointMetadata, dict[str, np.ndarray]]:
        """Return the progress of the episode and the hidden state, for a successor that loads the same policy file."""
        arrays = {f"hidden_{at}": part for at, part in enumerate(self.hidden or ())}
        meta = self._meta(
            arrays, hyperparameters={}, exploration={}, budget=0, epoch=0, state=(), linked=False, random={}, visits=[]
        )
        return meta, arrays

    def restore(self, meta: CheckpointMetadata, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue from the checkpoint of an agent with the same policy; UserError when its arrays do not fit."""
        self.hidden = self.policy.stored(arrays, source)
        super().restore(meta, arrays, source)


class BatchPolicyAgent:
    """Drives N robots through an evaluation with a frozen policy."""

    def __init__(self, policy: FrozenPolicy):
        self._policy = policy
        self._hidden: Hidden = None

    def __call__(self, episode: Episode) -> np.ndarray:
        """Return the motor commands (N, 2) of one tick."""
        motors, self._hidden = self._policy.motors(episode, self._hidden)
        return motors


class PolicyFile:
    """Loads a policy and the statistics of its observations once, and makes agents of it.

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
        """Make a driver of many robots for an evaluation."""
        return BatchPolicyAgent(self._policy(arena))

    def _policy(self, arena: Arena) -> FrozenPolicy:
        return FrozenPolicy(self._model, self._file, arena, self._normalize)
