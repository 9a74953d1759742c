"""The action-perception loop of one robot (section 5.1 and figure 7 of the paper)."""

from typing import Self

import numpy as np
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.checkpoint import CheckpointMetadata
from phototaxis.runtime.seated import SeatedAgent, Step
from phototaxis.task import ACTIONS, PerceptState, action_of
from phototaxis.wire.messages import Readings

from phototaxis_agent.policy import Policy


class Agent(SeatedAgent):
    """Turns readings into commands, and lets its policy learn from what they led to.

    It learns from the action that the readings report as applied, so that it can also learn from another agent's
    driving. From a command that is not one of the nine actions it learns nothing, and the next transition does not
    continue the one before.
    """

    def __init__(self, policy: Policy):
        super().__init__(policy.name, policy.task)
        self.policy, self.learner, self.visits = policy, policy.learner, policy.visits
        self._reward = policy.task.scheme()
        self._state: PerceptState = ()
        self._linked = False

    def decide(self, readings: Readings, over: bool) -> tuple[Step, tuple[float, float]]:
        """Perceive, learn from the last action, choose the next."""
        policy, episode, before = self.policy, self.episode, self._state
        policy.tick = readings.tick
        state, number = policy.perceive(readings, episode.history)
        reward, error, linked = self._reward(episode), 0.0, False
        if not episode.steps:
            self._state = state + self.learner.context
        else:
            applied = action_of(readings.left, readings.right) if readings.author else -1
            self._state = state + self.learner.remember(before, applied, episode.history.gain)
            if policy.learning and applied >= 0:
                first, linked = policy.shared or not self._linked, True
                error = policy.learn(before, applied, reward, self._state, episode.terminated, first)
        self._linked = linked
        temperature = policy.temperature
        action = -1 if over else policy.choose(self._state, temperature)
        step = Step(number, action, reward, error, temperature)
        return step, (0.0, 0.0) if over else ACTIONS[action]

    def another(self) -> Self:
        self.policy.shared = True
        return type(self)(self.policy)

    def enter(self, arena: Arena) -> None:
        super().enter(arena)
        self.policy.near = arena.sensing.near

    def table(self) -> list[float]:
        return self.policy.table()

    def current(self) -> list[float]:
        return self.policy.row(self._state) if self._state else [0.0] * len(ACTIONS)

    def checkpoint(self) -> tuple[CheckpointMetadata, dict[str, np.ndarray]]:
        fields, arrays = self.policy.save()
        return self._meta(arrays, state=self._state, linked=self._linked, **fields), arrays

    def prove(self, arrays: dict[str, np.ndarray]) -> None:
        self.learner.prove(arrays)

    def restore(self, meta: CheckpointMetadata, arrays: dict[str, np.ndarray], source: str) -> None:
        """Continue from a checkpoint, bit for bit.

        Raises
        ------
        UserError, ComponentFailed
            as in `Policy.take_over`.
        """
        self.policy.restore(meta, arrays, source)
        super().restore(meta, arrays, source)
        self._state, self._linked = meta.state, meta.linked
