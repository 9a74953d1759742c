"""A policy that Stable-Baselines3 has learned, in the driver's seat: frozen, and an agent like others."""

import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from phototaxis.arena import Arena
from phototaxis.checkpoint import Meta
from phototaxis.errors import UserError
from phototaxis.messages import Command, End, Readings, World
from phototaxis.options import convert
from phototaxis.task import ACTIONS, Memory, TaskOptions, lit

from phototaxis_gym.spaces import MOTORS, observation, rewards

PERCEPTS = ("simple", "rich", "continuous", "sensors")
_INDEX = {motors: index for index, motors in enumerate(ACTIONS)}


def load(file: Path, trusted: bool) -> Any:
    """The model in a file of Stable-Baselines3.

    Raises
    ------
    UserError
        when the file is not trusted, not such a file, or Stable-Baselines3 is not installed.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            data = json.loads(archive.read("data"))
            module = str(data["policy_class"]["__module__"])
    except FileNotFoundError:
        raise UserError(f"{file}: there is no such file") from None
    except (zipfile.BadZipFile, zlib.error, RuntimeError, OSError, KeyError, TypeError, ValueError):
        raise UserError(f"{file}: not a policy that Stable-Baselines3 has saved") from None
    if not trusted:
        raise UserError(
            f"{file}: a file of Stable-Baselines3 can run any code when it is loaded; "
            f"if you trust who made it, add --trust"
        )
    try:
        import stable_baselines3 as sb3
    except ModuleNotFoundError as error:
        raise UserError(f"{file} needs the package {error.name}: pip install stable-baselines3") from None
    by_module = {"dqn": sb3.DQN, "sac": sb3.SAC, "td3": sb3.TD3}
    found = by_module.get(module.split(".")[1] if "." in module else "")
    algorithm = found or (sb3.PPO if "clip_range" in data else sb3.A2C)
    try:
        return algorithm.load(file, device="cpu")
    except Exception as error:  # whatever a pickle does
        raise UserError(f"{file}: cannot be loaded: {type(error).__name__}: {error}") from None


class PolicyAgent:
    """Turns readings into the commands of a frozen policy; has what the agent's process asks of an `Agent`.

    Which percept and which actions it has follows from the policy's spaces.

    Raises
    ------
    UserError
        when they are none of ours.
    """

    def __init__(self, model: Any, file: Path, world: World, cap: int):
        self.name = self.author = f"policy-{file.stem}"
        near = world.arena
        self.enter(near)
        self._model = model
        percept = next((name for name in PERCEPTS if observation(name, near).space == model.observation_space), "")
        discrete = model.action_space == spaces.Discrete(len(ACTIONS))
        if not percept or not (discrete or model.action_space == spaces.Box(-1.0, 1.0, (2,), np.float32)):
            theirs = f"observes {model.observation_space} and acts in {model.action_space}"
            raise UserError(f"{file}: {theirs}: not the spaces of an environment of phototaxis")
        self._observe, self._reward = observation(percept, near), rewards("own", percept)
        self._discrete, self._percept, self._cap = discrete, percept, cap
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
            self._run, self._episode, self._steps = readings.run, readings.episode, -1
        self._tick, self._steps = readings.tick, self._steps + 1
        memory = self._memory
        memory.see(readings)
        reward = self._reward(max(memory.before), readings, memory.unchanged) if self._steps else 0.0
        end: End = "reached" if lit(readings) else "cap" if self._steps >= self._cap else ""
        action, left, right = -1, 0.0, 0.0
        if not end:
            chosen, _ = self._model.predict(np.asarray(self._observe(readings, memory)), deterministic=True)
            left, right = map(float, MOTORS[int(chosen)] if self._discrete else chosen)
            action = _INDEX.get((left, right), -1)
        self.last = (0, action, reward, 0.0, 0.0)
        self.command = Command(readings.run, readings.tick, self.author, left, right, end)
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
        command = self.command
        meta = Meta(
            learner=self.name, percept=self.task.percept, reward="own", cap=self._cap, hyperparameters={},
            exploration={}, budget=0, run=self._run, tick=self._tick, episode=self._episode, epoch=0, steps=self._steps,
            lights=list(self._memory.lights), state=(), linked=False,
            answer=None if command is None else (command.left, command.right, command.end),
            random={}, visits=[], arena=self.arena, arena_digest=self.arena_digest, learner_hash="",
        )  # fmt: skip
        return meta, {}

    def restore(self, meta: Meta, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue where another one with the same policy is."""
        self._run, self._tick, self._episode, self._steps = meta.run, meta.tick, meta.episode, meta.steps
        self._memory.clear()
        self._memory.lights.extend(meta.lights)
        self.command = None if meta.answer is None else Command(meta.run, meta.tick, self.author, *meta.answer)


class PolicyFile:
    """Loads a policy at once, and makes agents of it."""

    def __init__(self, file: Path, trusted: bool):
        self._file, self._model = file, load(file, trusted)

    def __call__(self, world: World, cap: int) -> PolicyAgent:
        if world.robots > 1:
            raise UserError(f"{self._file}: a policy drives one robot; this world has {world.robots}")
        return PolicyAgent(self._model, self._file, world, cap)
