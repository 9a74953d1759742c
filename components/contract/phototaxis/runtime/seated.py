"""The base of everything that can drive one robot: a learning agent or a frozen policy."""

from typing import Any, NamedTuple, Self

import numpy as np

from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import CheckpointMetadata, learner_hash
from phototaxis.task import Episode, TaskOptions
from phototaxis.wire.messages import ENDS, Command, Readings


class Step(NamedTuple):
    """What the agent perceived, chose and learned at one tick, for the recording."""

    percept: int
    """The number of the percept's state; 0 where states cannot be counted."""
    action: int
    """Index into `ACTIONS`; −1 for none of them."""
    reward: float
    td_error: float
    temperature: float


class SeatedAgent:
    """Answers one robot's readings with commands. A subclass decides; this class keeps the robot's episode.

    Parameters
    ----------
    name : name of the learner or policy; a checkpoint fits only an agent of the same name and percept.
    task : percept, reward, and the steps after which an episode is truncated.

    Attributes
    ----------
    author : the id with which the commands are signed.
    arena, arena_digest : name and digest of the arena that was entered last; "" for none.
    episode : the robot's present episode.
    command : the answer to the last tick.
    last : what the agent perceived, chose and learned at the last tick.
    visits : how often each state of the percept was met; empty where states are not counted.
    """

    def __init__(self, name: str, task: TaskOptions):
        self.name = self.author = name
        self.task = task
        self.arena = self.arena_digest = ""
        self.episode = Episode(task.max_episode_steps)
        self.command: Command | None = None
        self.last = Step(0, -1, 0.0, 0.0, 0.0)
        self.visits: list[int] = []

    def decide(self, readings: Readings, over: bool) -> tuple[Step, tuple[float, float]]:
        """Take in readings that `episode` has followed, and choose the motor command: (0, 0) if the episode is over."""
        raise NotImplementedError

    def __call__(self, readings: Readings) -> Command:
        """Answer one tick."""
        episode = self.episode
        episode.follow(readings)
        number: int = episode.end
        end = ENDS[number]
        self.last, (left, right) = self.decide(readings, end != "")
        self.command = Command(
            run=readings.run, tick=readings.tick, author=self.author, left=left, right=right, end=end
        )
        return self.command

    def another(self) -> Self:
        """An agent for one more robot, with the same policy and an episode of its own."""
        raise NotImplementedError

    def enter(self, arena: Arena) -> None:
        """Note the arena in which the agent now drives."""
        self.arena, self.arena_digest = arena.name, arena.digest

    @property
    def tick(self) -> tuple[str, int]:
        """Run and tick of the last answer."""
        return self.episode.run, self.episode.tick

    def table(self) -> list[float]:
        """Q of every state and action, flattened row by row, 9 a row; empty where there are no such values."""
        return []

    def current(self) -> list[float]:
        """Q of the present percept for each of the 9 actions; empty where there are no such values."""
        return []

    def checkpoint(self) -> tuple[CheckpointMetadata, dict[str, np.ndarray]]:
        """Everything needed to continue bit for bit."""
        raise NotImplementedError

    def prove(self, arrays: dict[str, np.ndarray]) -> None:
        """Raise an error unless the arrays of a checkpoint bring back what was learned."""

    def restore(self, meta: CheckpointMetadata, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue from a checkpoint, bit for bit; the next readings of another run begin an episode.

        A subclass takes over what it put into the checkpoint. `source` names the checkpoint in errors.
        """
        episode = self.episode
        episode.run, episode.tick, episode.number = meta.run, meta.tick, meta.episode
        episode.history.restore(meta.lights, meta.steps)
        self.command = None
        if meta.answer is not None:
            left, right, end = meta.answer
            self.command = Command(run=meta.run, tick=meta.tick, author=self.author, left=left, right=right, end=end)

    def _meta(self, arrays: dict[str, np.ndarray], **own: Any) -> CheckpointMetadata:
        """The metadata of a checkpoint with these arrays; `own` are the fields that only the subclass knows."""
        episode, command = self.episode, self.command
        return CheckpointMetadata(
            learner=self.name,
            percept=self.task.percept,
            reward=self.task.reward,
            max_episode_steps=self.task.max_episode_steps,
            run=episode.run,
            tick=episode.tick,
            episode=episode.number,
            steps=episode.steps,
            lights=list(episode.history.lights),
            answer=None if command is None else (command.left, command.right, command.end),
            arena=self.arena,
            arena_digest=self.arena_digest,
            learner_hash=learner_hash(arrays),
            **own,
        )
