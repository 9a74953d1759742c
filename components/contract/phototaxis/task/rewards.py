"""The reward schemes: how much a step earns."""

from typing import Any, Literal

from msgspec import Struct

from phototaxis.task.episode import Episode

DARK = 0.005
"""Lower bound of a light reading (0..1) before its logarithm is taken (reward scheme "potential")."""

Scheme = Literal["difference", "static", "potential"]


class Reward(Struct, frozen=True):
    """The rewards of section 4.4, and one more scheme.

    The first case that holds decides: `goal` at the light; `collision` in front or at the rear; `unchanged` after 5
    steps of unchanged light. In all other cases the scheme rewards the change of the brighter of the two readings:

    - "difference" (the simple percept's): its difference from the previous step;
    - "static" (the rich percept's): `approach` for any increase;
    - "potential" (not in the paper): the difference of its logarithm, a potential-based shaping (Ng, Harada and
      Russell 1999): a closed path earns nothing, and equal relative gains of light earn the same near and far.
    """

    scheme: Scheme
    goal: float = 3.0
    collision: float = -2.0
    unchanged: float = -2.0
    approach: float = 2.0

    def __call__(self, episode: Episode) -> Any:
        """The reward of the episode's last step; 0 at its first observation, to which no step led."""
        history, now = episode.history, episode.now
        cases = [
            (episode.steps == 0, 0.0),
            (episode.terminated, self.goal),
            (now.front | now.rear, self.collision),
            (history.unchanged, self.unchanged),
        ]
        return history.arithmetic.first(cases, self._approach(episode))

    def _approach(self, episode: Episode) -> Any:
        """The reward of a step without goal, collision or unchanged light."""
        history = episode.history
        if self.scheme == "difference":
            return history.gain
        largest, _, log, first = history.arithmetic
        before, now = largest(*history.before), largest(*episode.now.light)
        if self.scheme == "static":
            return first([(now > before, self.approach)], 0.0)
        return log(largest(now, DARK) / largest(before, DARK))


REWARDS: dict[str, Reward] = {
    "difference": Reward("difference"),
    "static": Reward("static"),
    "potential": Reward("potential", goal=3.0, collision=-1.0, unchanged=-0.5),
}
