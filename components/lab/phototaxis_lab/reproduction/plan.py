"""What is run: the systems of the paper, those it proposes, and those that go beyond."""

from collections.abc import Iterator
from itertools import product

from phototaxis_lab.cell import Cell, System

SIMPLE = (300, 1000, 3000, 10_000)
RICH = (1000, 5000, 10_000, 30_000)
LONG = (100_000,)
"""Epochs, for claim 8."""

PAPER: dict[str, tuple[System, tuple[int, ...]]] = {
    "Q-table, simple": (System("qtable", "simple", "difference"), SIMPLE),
    "net, simple": (System("ann", "simple", "difference"), SIMPLE),
    "Q-table, rich": (System("qtable", "rich", "static"), RICH + LONG),
    "net, rich": (System("ann", "rich", "static"), RICH + LONG),
    "Q-table, simple, static reward": (System("qtable", "simple", "static"), (3000,)),
    "net, simple, static reward": (System("ann", "simple", "static"), (3000,)),
    "Q-table, rich, difference reward": (System("qtable", "rich", "difference"), (30_000,)),
    "net, rich, difference reward": (System("ann", "rich", "difference"), (30_000,)),
}
"""The paper's four systems, and each with the other's reward (section 6.2 hopes for that comparison)."""

PROPOSED: dict[str, tuple[System, tuple[int, ...]]] = {
    f"{name}, {percept}": (System(learner, percept, reward), epochs)
    for (name, learner), (percept, reward, epochs) in product(
        (("linear net", "ann-linear"), ("net per action", "ann-per-action"), ("Elman net", "elman")),
        (("simple", "difference", (1000, 3000)), ("rich", "static", (10_000,))),
    )
}
"""Section 8, future directions."""
