"""The paper's claims; for each a function measures it and derives a verdict."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from phototaxis.task import ACTIONS, PERCEPTS

from phototaxis_lab.cell import Outcome
from phototaxis_lab.statistics import Interval, difference_interval, mean_interval, median_interval

Data = Mapping[str, Mapping[int, Sequence[Outcome]]]
"""Outcomes by name of the system (as in `plan`) and number of epochs; one for each seed."""


class Finding(NamedTuple):
    """The measurement for a claim, and the verdict."""

    measured: str
    verdict: str
    """confirmed, refuted or undecided."""
    why: str
    """A remark on the measurement or on its cause."""


class Claim(NamedTuple):
    """A claim of the paper."""

    section: str
    says: str
    judge: Callable[[Data], Finding]


def rates(outcomes: Sequence[Outcome]) -> list[float]:
    """Return the success rates within 300 steps, one for each seed."""
    return [outcome.success_rate for outcome in outcomes]


def mean(outcomes: Sequence[Outcome]) -> str:
    """Format the mean success and its interval."""
    return f"{np.mean(rates(outcomes)):.0%} {between(mean_interval(rates(outcomes)))}"


def between(interval: Interval, sign: str = "") -> str:
    """Format an interval of shares in per cent."""
    return f"[{interval.low:{sign}.0%}, {interval.high:{sign}.0%}]"


def decide(intervals: Sequence[Interval], level: float = 0.0) -> str:
    """Return "confirmed" when all intervals lie above the level, "refuted" when one lies below it, else "undecided"."""
    if all(interval.low > level for interval in intervals):
        return "confirmed"
    return "refuted" if any(interval.high < level for interval in intervals) else "undecided"


def compare(data: Data, better: str, worse: str, epochs: Sequence[int]) -> tuple[str, list[Interval]]:
    """Compare the success of two systems after each number of epochs; return words, and intervals of the difference."""
    words, intervals = [], []
    for number in epochs:
        ours, theirs = rates(data[better][number]), rates(data[worse][number])
        gain = difference_interval(ours, theirs)
        words.append(f"{number:,} epochs: {np.mean(ours):.0%} − {np.mean(theirs):.0%}, difference {between(gain, '+')}")
        intervals.append(gain)
    return "; ".join(words), intervals


def table_sizes(data: Data) -> Finding:
    """Claim 1."""
    sizes = [math.prod(PERCEPTS[name].sizes) * len(ACTIONS) for name in ("simple", "rich")]
    verdict = "confirmed" if sizes == [216, 3600] else "refuted"
    why = "24 · 9 and 400 · 9, by the definitions of section 4.2; the rich robot uses only 6 of the 9 columns"
    return Finding(f"{sizes[0]} and {sizes[1]:,} entries", verdict, why)


def simple_table(data: Data) -> Finding:
    """Claim 2."""
    found = rates(data["Q-table, simple"][3000])
    interval = median_interval(found)
    good = sum(rate >= 0.8 for rate in found)
    return Finding(
        f"median {np.median(found):.0%} {between(interval)}; {good} of {len(found)} seeds at 80% or more, worst "
        f"{min(found):.0%}",
        decide([interval], 0.8),
        "the outcomes are bimodal (most seeds learn it, some do not), so we judge the median",
    )


def simple_net_is_worse(data: Data) -> Finding:
    """Claim 3."""
    words, gains = compare(data, "Q-table, simple", "net, simple", [3000])
    return Finding(
        words,
        decide(gains),
        "the input codes the brighter side as 0, ½, 1, and in the range of a sigmoid the rewards differ by little",
    )


def rich_is_not_learnt(data: Data) -> Finding:
    """Claim 4."""
    words, intervals = [], []
    for name in ("Q-table, rich", "net, rich"):
        found = [data[name][epochs] for epochs in (5000, 10_000, 30_000)]
        words.append(f"{name.split(',')[0]} {', '.join(map(mean, found))}")
        intervals += [mean_interval(rates(outcomes)) for outcomes in found]
    if all(interval.high <= 0.3 for interval in intervals):
        verdict = "confirmed"
    else:
        verdict = "refuted" if any(interval.low > 0.3 for interval in intervals) else "undecided"
    return Finding(
        "after 5,000, 10,000, 30,000 epochs: " + "; ".join(words),
        verdict,
        "+2 for any approach rewards wiggling in place as well as coming closer; how much this costs depends on the "
        "discount, which the paper does not give: see the rows with other γ below",
    )


def rich_net_is_better(data: Data) -> Finding:
    """Claim 5."""
    words, gains = compare(data, "net, rich", "Q-table, rich", [5000, 10_000, 30_000])
    return Finding(words, decide(gains), "judged after each of the paper's three numbers of epochs")


def roughness(outcomes: Sequence[Outcome]) -> list[float]:
    """Return how unsteady the reward is, for each seed: standard deviation over mean size of 100 equal stretches."""
    stretches = [np.diff(outcome.rewards, prepend=0.0) for outcome in outcomes]
    return [float(one.std() / np.abs(one).mean()) for one in stretches]


def rich_net_is_steadier(data: Data) -> Finding:
    """Claim 6."""
    table, net = (roughness(data[name][30_000]) for name in ("Q-table, rich", "net, rich"))
    gain = difference_interval(table, net)
    return Finding(
        f"spread of the reward of 300 epochs over its mean size: table {np.mean(table):.2f}, net {np.mean(net):.2f}, "
        f"difference [{gain.low:+.2f}, {gain.high:+.2f}]",
        decide([gain]),
        "over 30,000 epochs in 100 stretches",
    )


CROWDED = (1, 0, 0, 1), (2, 0, 0, 1), (0, 0, 0, 0)
"""The states of the simple percept in which the paper's robot spent most of its time (section 6.2)."""


def state_shares(outcomes: Sequence[Outcome]) -> np.ndarray:
    """Return the share of the learning steps spent in each state, shape (seeds, states)."""
    visits = np.array([outcome.visits for outcome in outcomes], dtype=float)
    return visits / visits.sum(axis=1, keepdims=True)


def time_piles_up(data: Data) -> Finding:
    """Claim 7."""
    outcomes, states = data["Q-table, simple"][3000], list(np.ndindex(*PERCEPTS["simple"].sizes))
    share = state_shares(outcomes).mean(axis=0)
    top = [states[index] for index in np.argsort(-share)[:3]]
    named = ", ".join(f"{state} {share[states.index(state)]:.0%}" for state in CROWDED)
    first = ", ".join(f"{state} {share[states.index(state)]:.0%}" for state in top)
    unchanged = share[[index for index, state in enumerate(states) if state[3]]].sum()
    back = np.mean([outcome.reversals for outcome in outcomes])
    verdict = "confirmed" if set(top) == set(CROWDED) else "refuted"
    return Finding(
        f"{named}; most time is spent in {first}; with unchanged light {unchanged:.0%}; {back:.0%} of the steps "
        f"reverse the one before",
        verdict,
        "of random steps 22% reverse the previous one; in a room of 10 m with steps of 0.5 m the light seldom "
        "stays the same for five steps; in the arena `pyro-realtime`, steps of 0.1 s, it does",
    )


def longer_separates(data: Data) -> Finding:
    """Claim 8."""
    words, (before, after) = compare(data, "net, rich", "Q-table, rich", [30_000, 60_000])
    apart = [gain.low > 0 or gain.high < 0 for gain in (before, after)]
    return Finding(
        words,
        "refuted" if not apart[1] else "undecided" if apart[0] else "confirmed",
        "it would be confirmed if the interval excluded 0 after 60,000 epochs but not after 30,000",
    )


def linear_is_better(data: Data) -> Finding:
    """Claim 9."""
    simple, first = compare(data, "linear net, simple", "net, simple", [3000])
    rich, second = compare(data, "linear net, rich", "net, rich", [10_000])
    return Finding(
        f"simple, {simple}; rich, {rich}",
        decide(first + second),
        "the rewards need no mapping, and differences of Q are not squashed",
    )


def net_per_action_is_faster(data: Data) -> Finding:
    """Claim 10."""
    simple, first = compare(data, "net per action, simple", "net, simple", [1000, 3000])
    rich, second = compare(data, "net per action, rich", "net, rich", [5000])
    return Finding(
        f"simple, {simple}; rich, {rich}",
        decide(first + second),
        "faster means more success after the same number of epochs",
    )


def elman(data: Data) -> Finding:
    """Claim 11."""
    simple, first = compare(data, "Elman net, simple", "net, simple", [3000])
    rich, second = compare(data, "Elman net, rich", "net, rich", [10_000])
    return Finding(
        f"simple, {simple}; rich, {rich}",
        decide(first + second),
        'the paper makes no claim ("we are not sure"); we test whether it is better than the plain net',
    )


CLAIMS = (
    Claim("4.2, 5.1", "The table has 216 entries (simple) and 3,600 (rich).", table_sizes),
    Claim("6.2", "Simple, table: success upwards of 80% after 3,000 epochs.", simple_table),
    Claim("6.2", "Simple: the net is worse than the table.", simple_net_is_worse),
    Claim("6.1", "Rich: neither above 30% after 5,000, 10,000 and 30,000 epochs.", rich_is_not_learnt),
    Claim("6.1", "Rich: the net is better than the table.", rich_net_is_better),
    Claim("6.1", "Rich: the net's reward is the more stable one.", rich_net_is_steadier),
    Claim(
        "6.2", "Time piles up in (1,0,0,1), (2,0,0,1) and (0,0,0,0), with forward-backward oscillation.", time_piles_up
    ),
    Claim("7", "Rich: more than 30,000 epochs would separate net and table.", longer_separates),
    Claim("8", "A linear output works better than the sigmoid.", linear_is_better),
    Claim("8", "One net for each action trains faster.", net_per_action_is_faster),
    Claim("8", "A recurrent Elman net: advantages unknown.", elman),
)
