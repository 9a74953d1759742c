"""What a step earns."""

from typing import Any, Literal

from msgspec import Struct

from phototaxis.task.episode import Episode

DARK = 0.005
"""The light reading (0..1) below which its logarithm falls no more (reward scheme "potential")."""

Scheme = Literal["difference", "static", "potential"]


class Reward(Struct, frozen=True):
    """The reinforcement values of section 4.4, and one more scheme.

    The first that holds decides: `goal` at the light; `collision` in front or at the rear; `unchanged` while the
    light is unchanged for 5 steps. In all other cases the brighter of the two readings does:

    - "difference" (the simple percept's): its difference to the last step;
    - "static" (the rich one's): `approach` for any increase;
    - "potential" (not the paper's): the difference of its logarithm, a potential-based shaping (Ng, Harada
      and Russell 1999): a circle earns nothing, and a step towards the light earns alike near and far.
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
        """What a step earns that met nothing special."""
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
