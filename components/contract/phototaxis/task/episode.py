"""Follows an episode: where it begins, how many steps it has, and when it ends."""

from typing import Any

from phototaxis.task.history import LightHistory
from phototaxis.task.observation import at_goal
from phototaxis.wire.messages import ENDS, Readings

TERMINATED, TRUNCATED, RESET = (ENDS.index(end) for end in ("terminated", "truncated", "reset"))
"""Indices of an episode's ends in `ENDS`."""


class Episode:
    """The present episode of one robot, or those of N robots. A policy may be shared; an episode is a robot's own.

    Parameters
    ----------
    max_episode_steps : steps after which an episode is truncated; infinity for no limit.
    robots : N for arrays (N,) in place of numbers, as in `LightHistory`; None for one robot.

    Attributes
    ----------
    now : the newest observation.
    terminated : whether the robot is at the light.
    history : the light readings up to `now`.
    run, number, tick : run, episode and tick of the newest readings given to `follow`; "", −1 and −1 before the first.
    """

    def __init__(self, max_episode_steps: float, robots: int | None = None):
        self.history = LightHistory(robots)
        self.now: Any = None
        self.terminated: Any = False
        self.run, self.number, self.tick = "", -1, -1
        self._max_episode_steps = max_episode_steps

    def begin(self, observation: Any, which: Any = True) -> None:
        """Begin an episode with this observation; robots outside the mask `which` (N,) continue theirs."""
        self.now, self.terminated = observation, at_goal(observation)
        self.history.begin(observation.light, which)

    def step(self, observation: Any) -> None:
        """Take in the observation after one more step."""
        self.now, self.terminated = observation, at_goal(observation)
        self.history.step(observation.light)

    def follow(self, readings: Readings) -> None:
        """Take in one robot's readings: they begin an episode unless they are the next tick of the present one."""
        goes_on = readings.tick == self.tick + 1 and readings.episode == self.number and readings.run == self.run
        self.run, self.number, self.tick = readings.run, readings.episode, readings.tick
        (self.step if goes_on else self.begin)(readings)

    @property
    def steps(self) -> Any:
        """Steps since the episode began; 0 at its first observation."""
        return self.history.steps

    @property
    def truncated(self) -> Any:
        """Whether the episode has reached the step cap."""
        return self.steps >= self._max_episode_steps

    @property
    def end(self) -> Any:
        """How the episode ends at `now`, as an index into `ENDS`; 0 while it goes on."""
        return self.history.arithmetic.first([(self.terminated, TERMINATED), (self.truncated, TRUNCATED)], 0)
