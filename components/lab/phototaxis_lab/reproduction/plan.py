"""The experiments: the systems of the paper, those that it proposes, and those that go beyond it."""

from collections.abc import Mapping

from phototaxis_lab.cell import Cell, System

Plan = Mapping[str, tuple[System, tuple[int, ...]]]
"""Systems by their name on the page, each with its numbers of epochs."""

SIMPLE = 300, 1000, 3000, 10_000
RICH = 1000, 5000, 10_000, 30_000, 60_000

PAPER: Plan = {
    "Q-table, simple": (System("qtable", "simple", "difference"), SIMPLE),
    "net, simple": (System("ann", "simple", "difference"), SIMPLE),
    "Q-table, rich": (System("qtable", "rich", "static"), RICH),
    "net, rich": (System("ann", "rich", "static"), RICH),
}
"""The four systems of sections 5 and 6, each with the reward that the paper gives it."""

EXCHANGED: Plan = {
    "Q-table, simple, static reward": (System("qtable", "simple", "static"), (3000,)),
    "net, simple, static reward": (System("ann", "simple", "static"), (3000,)),
    "Q-table, rich, difference reward": (System("qtable", "rich", "difference"), (10_000,)),
    "net, rich, difference reward": (System("ann", "rich", "difference"), (10_000,)),
}
"""The same systems with the rewards of simple and rich exchanged: the comparison that section 6.2 hopes for."""

DISCOUNTS: Plan = {
    "Q-table, rich, γ 0.5": (System("qtable", "rich", "static", options=(("gamma", 0.5),)), (10_000,)),
    "Q-table, rich, γ 0.95": (System("qtable", "rich", "static", options=(("gamma", 0.95),)), (10_000,)),
    "net, rich, γ 0.9": (System("ann", "rich", "static", options=(("gamma", 0.9),)), (10_000,)),
}
"""The rich systems with other discounts, because the paper does not give its own."""

PROPOSED: Plan = {
    "linear net, simple": (System("ann-linear", "simple", "difference"), (1000, 3000)),
    "net per action, simple": (System("ann-per-action", "simple", "difference"), (1000, 3000)),
    "Elman net, simple": (System("elman", "simple", "difference"), (1000, 3000)),
    "linear net, rich": (System("ann-linear", "rich", "static"), (5000, 10_000)),
    "net per action, rich": (System("ann-per-action", "rich", "static"), (5000, 10_000)),
    "Elman net, rich": (System("elman", "rich", "static"), (5000, 10_000)),
}
"""The systems that section 8 (future directions) proposes."""

BEYOND: Plan = {
    "qlambda, simple": (System("qlambda", "simple"), (300, 1000, 3000)),
    "mirror, simple": (System("mirror", "simple"), (300, 500, 1000, 3000)),
    "dqn, simple": (System("dqn", "simple"), (1000, 3000)),
    "qlambda, rich": (System("qlambda", "rich"), (5000, 10_000)),
    "mirror, rich": (System("mirror", "rich"), (5000, 10_000)),
    "dqn, rich": (System("dqn", "rich"), (5000, 10_000)),
    "dqn, continuous": (System("dqn", "continuous"), (500, 1000)),
}
"""Learners that the paper does not have, with their own rewards and hyperparameters."""

SHADOWS: Plan = {
    f"{learner}, {percept}, shadows": (System(learner, percept, arena="shadows"), (epochs,))
    for learner, percept, epochs in (
        ("qtable", "simple", 5000),
        ("ann", "simple", 5000),
        ("elman", "simple", 5000),
        ("qlambda", "simple", 5000),
        ("mirror", "simple", 5000),
        ("mirror", "rich", 5000),
        ("dqn", "simple", 5000),
        ("dqn", "rich", 5000),
        ("dqn", "continuous", 5000),
    )
}
"""All kinds of learners in an arena whose obstacles shadow the light."""

PARTS: Mapping[str, Plan] = {
    "paper": {**PAPER, **EXCHANGED, **DISCOUNTS, **PROPOSED},
    "beyond": {**BEYOND, **SHADOWS},
}
"""The parts that are computed one after the other, each with a folder of its own."""

WHOLE: Plan = {name: planned for plan in PARTS.values() for name, planned in plan.items()}
"""All systems of all parts."""

FRESH: Plan = {
    f"{learner}, {percept}": (System(learner, percept), (epochs,))
    for learner, percept, epochs in (
        ("qtable", "simple", 3000),
        ("ann", "simple", 3000),
        ("ann-linear", "simple", 3000),
        ("ann-per-action", "simple", 3000),
        ("elman", "simple", 3000),
        ("qlambda", "simple", 3000),
        ("qlambda", "rich", 10_000),
        ("mirror", "simple", 1000),
        ("mirror", "rich", 10_000),
        ("dqn", "simple", 3000),
        ("dqn", "continuous", 1000),
    )
}
"""Every learner with its presets, on seeds on which nothing was tuned and nothing else is reported."""


def fresh_seeds(seeds: range) -> range:
    """Return five times as many seeds as `seeds` has, from 1,000 on."""
    return range(1000, 1000 + 5 * len(seeds))


def cells(plan: Plan, seeds: range) -> list[Cell]:
    """Return the cells of a plan: each system and number of epochs with every seed."""
    return [Cell(system, epochs, seed) for system, budgets in plan.values() for epochs in budgets for seed in seeds]
