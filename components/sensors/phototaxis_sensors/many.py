"""The sensor suites of many robots on the bus: from the columns of a state to those of readings."""

import numpy as np
from phototaxis.columns import FLAG, pack, unpack
from phototaxis.errors import UserError
from phototaxis.messages import ReadingsOfMany, StateOfMany, World

from phototaxis_sensors.choice import Choice


class SuiteOfMany:
    """Readings as a pure function of (world, state).

    Raises
    ------
    UserError
        when the models remember: the robots' episodes begin at different ticks.
    """

    def __init__(self, world: World, choice: Choice):
        if choice.remembers:
            raise UserError(f"an FMU senses for one robot; this world has {world.robots}: start it without --robots")
        self._robots, self._suite = world.robots, choice.crowd(world, world.robots)

    def __call__(self, state: StateOfMany) -> ReadingsOfMany:
        """Answer one tick.

        Raises
        ------
        Refused
            when a column is not of this many robots.
        """
        poses = unpack(state.pose, self._robots, 3)
        unpack(state.contact, self._robots, 2, FLAG)
        sonar, light = self._suite(state.tick, np.ascontiguousarray(poses.T))
        return ReadingsOfMany(
            run=state.run, tick=state.tick, epoch=state.epoch, episode=state.episode, sonar=pack(sonar),
            light=pack(light), contact=state.contact, left=state.left, right=state.right, author=state.author,
            driver=state.driver,
        )  # fmt: skip
