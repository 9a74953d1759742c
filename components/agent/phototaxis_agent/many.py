"""One learner that drives many robots: each has its own percept and memory, all learn into the same values."""

from typing import Any

import numpy as np
from phototaxis.columns import COUNT, FLAG, pack, unpack
from phototaxis.messages import ENDS, CommandOfMany, Readings, ReadingsOfMany
from phototaxis.task import Memory

from phototaxis_agent.agent import Agent, Step


class Follower(Agent):
    """One more robot of an agent: everything is the leader's but what this robot meets."""

    def __init__(self, leader: Agent):
        self.__dict__.update(leader.__dict__)
        self._leader = leader
        self._memory, self._state, self._linked = Memory(), None, False
        self._run, self._tick, self._episode, self._steps = "", -1, -1, 0
        self.last, self.command = Step(0, -1, 0.0, 0.0, 0.0), None

    @property
    def epoch(self) -> int:  # type: ignore[override] - a plain attribute of the leader
        """Learning steps of all robots."""
        return self._leader.epoch

    @epoch.setter
    def epoch(self, value: int) -> None:
        self._leader.epoch = value


class Flock:
    """Answers for N robots, one after the other in each tick, so that runs can be repeated.

    What the learner hears are single transitions: none continues the one before, so eligibility traces
    reach back no further than one step.
    """

    def __init__(self, leader: Agent, robots: int):
        leader.alone = False
        self._robots: list[Agent] = [leader, *(Follower(leader) for _ in range(robots - 1))]

    def __call__(self, readings: ReadingsOfMany) -> CommandOfMany:
        """Answer one tick.

        Raises
        ------
        Refused
            when a column is not of this many robots.
        """
        count = len(self._robots)
        episode = unpack(readings.episode, count, kind=COUNT).tolist()
        sonar = unpack(readings.sonar, count, 16).T.tolist()
        light = unpack(readings.light, count, 2).T.tolist()
        contact = unpack(readings.contact, count, 2, FLAG).astype(bool).T.tolist()
        left, right = unpack(readings.left, count).tolist(), unpack(readings.right, count).tolist()
        answers: list[Any] = []
        for row, robot in enumerate(self._robots):
            front, rear = contact[row]
            seen = Readings(
                run=readings.run, tick=readings.tick, episode=episode[row], epoch=readings.epoch, sonar=sonar[row],
                light=tuple(light[row]), front=front, rear=rear, left=left[row], right=right[row],
                author=readings.author, driver=readings.driver,
            )  # fmt: skip
            answers.append(robot(seen))
        ends = np.array([ENDS.index(one.end) for one in answers])
        return CommandOfMany(
            run=readings.run, tick=readings.tick, author=self._robots[0].author,
            left=pack(np.array([one.left for one in answers])), right=pack(np.array([one.right for one in answers])),
            end=pack(ends, FLAG),
        )  # fmt: skip
