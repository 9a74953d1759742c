"""The learner that needs the fewest steps: least-squares SARSA(λ) on a table folded along the robot's symmetry.

Left and right are alike: a state and action share their entry with their mirror image, so every experience
counts twice. There is no learning rate: after every step the table is the exact least-squares solution for
all experience so far: the recursive least squares of Xu, He and Hu (2002) after
Bradtke and Barto (1996), with eligibility traces, which soften that percepts are not Markov states. The
reward scheme "potential" pays for approach alone.
"""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from msgspec import Meta, Struct
from phototaxis.task import ACTIONS, MIRRORED, Percept, PerceptState

from phototaxis_agent import context
from phototaxis_agent.learner import Learner, Transition, discrete, stored, stored_rows

MIN_TRACE = 0.01
"""A trace that has decayed below this is dropped."""


class Hyperparameters(Struct, frozen=True, kw_only=True):
    """Hyperparameters of the folded table."""

    gamma: Annotated[float, Meta(ge=0, lt=1)] = 0.8
    """discount factor γ of equation 1"""
    trace_decay: Annotated[float, Meta(ge=0, le=1)] = 0.8
    """trace decay λ: 0 fits each step to the next, 1 to all that followed"""
    initial_value: Annotated[float, Meta(ge=-100, le=100)] = 0.3
    """value of an entry without experience; optimism makes the robot try everything"""
    ridge: Annotated[float, Meta(gt=0, le=1000)] = 0.5
    """weight of the initial value, as a number of experiences"""
    context: Literal["none", "last"] = "last"
    """none: the percept alone is the state; last: also the last action and whether it got brighter"""


_UNKNOWN = [0] * len(ACTIONS)


class Mirror(Learner):
    """Entries of states and actions that were tried, each shared with its mirror image."""

    Options = Hyperparameters
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "": {
            "reward": "potential",
            "temperature_start": 0.12,
            "temperature_end": 0.06,
            "exploration_fraction": 0.6,
            "max_episode_steps": 200,
        },
        "rich": {"max_episode_steps": 100, "temperature_end": 0.1, "initial_value": 1.0, "ridge": 1.0},
    }

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self._options, self._percept, self._allowed = options, discrete(percept), list(percept.actions)
        if options.context == "last":
            self.context = context.INITIAL_CONTEXT
        self._entries: dict[PerceptState, list[int]] = {}
        self._met: list[tuple[float, ...]] = []
        self._table = np.array([options.initial_value])
        """Entry 0 stands for everything that was not tried yet."""
        self._spread = np.zeros((1, 1))
        """How far an error at one entry moves the others: the inverse of the least squares' matrix."""
        self._traces: dict[int, float] = {}
        self._open: tuple[float, ...] = ()
        """The last step, until the next one says what followed: entry, reward, the state it led to."""

    def remember(self, state: Any, action: Any, gain: Any) -> tuple[Any, ...]:
        return context.remember(action, gain) if self.context else ()

    def values(self, state: PerceptState) -> list[float]:
        table, entries = self._table, self._entries.get(state, _UNKNOWN)
        return [float(table[entries[action]]) for action in self._allowed]

    def learn(self, transition: Transition) -> float:
        """Fit the step before this one, now that the action that followed it is known."""
        state, action, reward, next_state, terminated, _, first = transition
        entry, error = self._entry(state, action), 0.0
        if self._open:
            last, last_reward, *reached = self._open
            error = self._fit(int(last), last_reward, self._best(tuple(reached)) if first else entry)
        if first:
            self._traces.clear()
        self._open = (entry, reward, *next_state)
        if terminated:
            error = self._fit(entry, reward, None)
            self._open = ()
            self._traces.clear()
        return error

    def _fit(self, entry: int, reward: float, following: int | None) -> float:
        """Let the table fit one more equation, Q(entry) = reward + γ Q(following), exactly; the error before."""
        gamma, size = self._options.gamma, len(self._met) + 1
        table, spread = self._table[:size], self._spread[:size, :size]
        fade = gamma * self._options.trace_decay
        self._traces = {one: fade * trace for one, trace in self._traces.items() if fade * trace > MIN_TRACE}
        self._traces[entry] = self._traces.get(entry, 0.0) + 1.0
        gain = np.zeros(size)
        for one, trace in self._traces.items():
            gain += trace * spread[:, one]
        error, slope, scale = reward - table[entry], spread[entry], 1 + gain[entry]
        if following is not None:
            error, slope = error + gamma * table[following], slope - gamma * spread[following]
            scale -= gamma * gain[following]
        gain /= scale
        table += error * gain
        spread -= np.multiply.outer(gain, slope)
        return float(error)

    def _best(self, state: PerceptState) -> int:
        """The entry of the best allowed action."""
        entries = self._entries.get(state, _UNKNOWN)
        return max((entries[action] for action in self._allowed), key=self._table.__getitem__)

    def _entry(self, state: PerceptState, action: int) -> int:
        """The entry of an action in a state, also that of their mirror image; made when it is first asked for."""
        entries = self._entries.setdefault(state, [0] * len(ACTIONS))
        if not entries[action]:
            image = context.mirror(self._percept, state) if self.context else self._percept.mirror(state)
            self._met.append((*state, action))
            number = len(self._met)
            if number == len(self._table):
                self._table = np.append(self._table, np.full(number, self._options.initial_value))
                self._spread = np.pad(self._spread, (0, number))
            self._spread[number, number] = 1 / self._options.ridge
            entries[action] = self._entries.setdefault(image, [0] * len(ACTIONS))[MIRRORED[action]] = number
        return entries[action]

    def save(self) -> dict[str, np.ndarray]:
        width, size = len(self._percept.sizes) + len(self.context) + 1, len(self._met) + 1
        return {
            "met": np.array(self._met, dtype=float).reshape(-1, width),
            "table": self._table[:size].copy(),
            "spread": self._spread[:size, :size].copy(),
            "traces": np.array(list(self._traces.items()), dtype=float).reshape(-1, 2),
            "open": np.array(self._open, dtype=float),
        }

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        fresh = Mirror(self._options, self._percept, np.random.default_rng())
        for *state, action in stored_rows(arrays, "met", len(self._percept.sizes) + len(self.context) + 1).tolist():
            fresh._entry(tuple(state), int(action))
        like = fresh.save()
        table, spread = (stored(arrays, name, like[name]) for name in ("table", "spread"))
        traces = stored_rows(arrays, "traces", 2)
        unfinished = stored(arrays, "open", np.zeros(len(arrays.get("open", ()))))
        fresh._table[: len(table)], fresh._spread[: len(table), : len(table)] = table, spread
        self._entries, self._met, self._table, self._spread = fresh._entries, fresh._met, fresh._table, fresh._spread
        self._traces = {int(entry): trace for entry, trace in traces.tolist()}
        self._open = tuple(unfinished.tolist())
