"""Drives many robots with one policy: each has its own episode, and all learn into the same values."""

import numpy as np
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.wire.columns import COUNT, FLAG, pack, unpack
from phototaxis.wire.messages import ENDS, BatchCommand, BatchReadings, Readings


class BatchDriver:
    """Answers for N robots, one after the other in each tick, so that runs can be repeated.

    The learner gets single transitions: none continues the one before, so eligibility traces reach back only
    one step.
    """

    def __init__(self, agent: SeatedAgent, robots: int):
        self._agents = [agent, *(agent.another() for _ in range(robots - 1))]

    def __call__(self, readings: BatchReadings) -> BatchCommand:
        """Answer one tick.

        Raises
        ------
        Refused
            when a column is not of this many robots.
        """
        count = len(self._agents)
        episode = unpack(readings.episode, count, kind=COUNT).tolist()
        sonar = unpack(readings.sonar, count, 16).T.tolist()
        light = unpack(readings.light, count, 2).T.tolist()
        contact = unpack(readings.contact, count, 2, FLAG).astype(bool).T.tolist()
        left, right = unpack(readings.left, count).tolist(), unpack(readings.right, count).tolist()
        answers = [
            agent(
                Readings(
                    run=readings.run, tick=readings.tick, episode=episode[row], epoch=readings.epoch, sonar=sonar[row],
                    light=tuple(light[row]), front=contact[row][0], rear=contact[row][1], left=left[row],
                    right=right[row], author=readings.author, driver=readings.driver,
                )
            )
            for row, agent in enumerate(self._agents)
        ]  # fmt: skip
        return BatchCommand(
            run=readings.run,
            tick=readings.tick,
            author=self._agents[0].author,
            left=pack(np.array([one.left for one in answers])),
            right=pack(np.array([one.right for one in answers])),
            end=pack(np.array([ENDS.index(one.end) for one in answers]), FLAG),
        )
