"""The learner that needs the fewest steps: SARSA(λ) on a table folded along the robot's symmetry.

Three ideas. Left and right are alike, so a state and action share their entry with their mirror image, and
every experience counts twice. Traces (Sutton and Barto, section 12.7) hand an error back to the steps that
led to it, which also softens that percepts are not Markov states. And the reward scheme "potential" pays for
approach alone. Where the percept tells too little, the last action and its effect are added to it.
"""

from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, Struct
from phototaxis.task import ACTIONS, MIRRORED, Percept, State

from phototaxis_agent import context
from phototaxis_agent.learner import Learner, Transition, discrete, falling, stored, stored_rows

FORGOTTEN = 0.01
"""A trace that has decayed below this is dropped."""


class Hyperparameters(Struct, frozen=True, kw_only=True):
    """Of the folded table."""

    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.35
    """learning rate at the first epoch; it falls geometrically to `alpha_end`"""
    alpha_end: Annotated[float, Meta(gt=0, le=1)] = 0.1
    """learning rate at the end of the budget and after it"""
    gamma: Annotated[float, Meta(ge=0, lt=1)] = 0.5
    """discount factor γ of equation 1"""
    decay: Annotated[float, Meta(ge=0, le=1)] = 0.5
    """trace decay λ: 0 corrects the last step alone, 1 the whole way that led here"""
    start: Annotated[float, Meta(ge=-100, le=100)] = 0.0
    """value of every entry at the beginning; optimism makes the robot try everything"""
    count: Literal["no", "yes"] = "no"
    memory: Literal["none", "last"] = "none"
    """none: the percept alone is the state; last: also the last action and whether it got brighter"""


class Mirror(Learner):
    """Entries of states and actions, each shared with its mirror image."""

    Options = Hyperparameters

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self._options = options
        sizes = discrete(percept, "mirror").sizes
        if options.memory == "last":
            sizes, self.context = (*sizes, *context.SIZES), context.BLANK
        self._entries, count = _fold(percept, sizes, bool(self.context))
        self._rows = {state: [entries[a] for a in percept.actions] for state, entries in self._entries.items()}
        self._table = [options.start] * count
        self._visits = [0] * count

        self._traces: dict[int, float] = {}
        self._open: tuple[float, ...] = ()
        """The last step, until the next one says what followed: entry, reward, the state it led to."""

    def remember(self, state: Any, action: Any, gain: Any) -> tuple[Any, ...]:
        return context.remember(action, gain) if self.context else ()

    def values(self, state: State) -> list[float]:
        table = self._table
        return [table[entry] for entry in self._rows[state]]

    def learn(self, transition: Transition) -> float:
        """Correct the step before this one, now that the action that followed it is known."""
        state, action, reward, following, terminated, progress, first = transition
        rate, error = falling(self._options.alpha, self._options.alpha_end, progress), 0.0
        entry = self._entries[state][action]
        if self._open:
            last, last_reward, *reached = self._open
            after = max(self.values(tuple(reached))) if first else self._table[entry]
            error = self._correct(int(last), last_reward + self._options.gamma * after, rate)
        if first:
            self._traces.clear()
        self._open = (entry, reward, *following)
        if terminated:
            error = self._correct(entry, reward, rate)
            self._open = ()
            self._traces.clear()
        return error

    def _correct(self, entry: int, target: float, rate: float) -> float:
        """Move an entry and what led to it towards a target; the error before."""
        fade = self._options.gamma * self._options.decay
        self._traces = {one: fade * trace for one, trace in self._traces.items() if fade * trace > FORGOTTEN}
        self._traces[entry] = 1.0
        error = target - self._table[entry]
        self._visits[entry] += 1
        if self._options.count == "yes":
            for one, trace in self._traces.items():
                self._table[one] += max(rate, 1 / (1 + self._visits[one])) * trace * error
        else:
            for one, trace in self._traces.items():
                self._table[one] += rate * trace * error
        return error

    def save(self) -> dict[str, np.ndarray]:
        traces = np.array(list(self._traces.items()), dtype=float).reshape(-1, 2)
        return {"table": np.array(self._table), "traces": traces, "open": np.array(self._open, dtype=float)}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        table, traces = stored(arrays, "table", np.array(self._table)), stored_rows(arrays, "traces", 2)
        unfinished = stored(arrays, "open", np.zeros(len(arrays.get("open", ()))))
        self._table, self._open = table.tolist(), tuple(unfinished.tolist())
        self._traces = {int(entry): trace for entry, trace in traces.tolist()}


def _fold(percept: Percept, sizes: tuple[int, ...], remembers: bool) -> tuple[dict[State, list[int]], int]:
    """The entry of each action in each state, mirror images sharing one; and how many entries there are."""
    entries: dict[tuple[State, int], int] = {}
    count = 0
    states = list(product(*map(range, sizes)))
    for state in states:
        image = context.mirror(percept, state) if remembers else percept.mirror(state)
        for action in range(len(ACTIONS)):
            if (state, action) not in entries:
                entries[state, action] = entries[image, MIRRORED[action]] = count
                count += 1
    return {state: [entries[state, action] for action in range(len(ACTIONS))] for state in states}, count
