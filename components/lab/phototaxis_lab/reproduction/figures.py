"""Draws the figures of the page; they are readable in print and without colour."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter
from phototaxis.runtime.disk import write_atomic
from phototaxis.task import ACTIONS

from phototaxis_lab.cell import CURVE_POINTS, Outcome
from phototaxis_lab.statistics import mean_interval

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "figure.dpi": 200,
    "svg.hashsalt": "phototaxis",
}
LOOKS = (
    ("#0072B2", "o", "-"), ("#D55E00", "s", "--"), ("#009E73", "^", "-."), ("#CC79A7", "D", ":"),
    ("#E69F00", "v", (0, (5, 1))), ("#56B4E9", "P", (0, (3, 1, 1, 1))), ("#000000", "X", (0, (1, 1))),
)  # fmt: skip
"""Okabe and Ito's colours, which colour-blind people can tell apart, each with a marker and a dash pattern."""

Runs = Mapping[int, Sequence[Outcome]]
"""The outcomes of one system by number of epochs; one for each seed."""


@mpl.rc_context(STYLE)
def success(path: Path, systems: Mapping[str, Runs], lines: Mapping[str, float], against: str = "epochs") -> None:
    """Draw the mean success of each system with its 95% interval, against epochs or episodes (figures 10 and 12).

    `lines` are levels to compare with, by their names.
    """
    figure, axes = _figure(5.2, 3.4)
    for (name, runs), (colour, marker, dashes) in zip(systems.items(), LOOKS, strict=False):
        rates = [[outcome.success_rate for outcome in outcomes] for outcomes in runs.values()]
        x = [
            epochs if against == "epochs" else float(np.mean([outcome.episodes for outcome in outcomes]))
            for epochs, outcomes in runs.items()
        ]
        low, high = np.array([mean_interval(rate) for rate in rates]).T
        axes.fill_between(x, 100 * low, 100 * high, color=colour, alpha=0.15, linewidth=0)
        means = [100 * np.mean(rate) for rate in rates]
        axes.plot(x, means, color=colour, marker=marker, linestyle=dashes, label=name, markersize=5)
    for name, level in lines.items():
        axes.axhline(100 * level, color="0.35", linewidth=0.9, linestyle=(0, (2, 2)))
        left = name.startswith("the paper")  # on the left, since the other levels may be close to it
        place, side = (0.01, "left") if left else (1.0, "right")
        axes.annotate(name, (place, 100 * level), xycoords=("axes fraction", "data"), ha=side, va="bottom", fontsize=7)
    axes.set_xscale("log")
    axes.set_ylim(0, 104)
    axes.set_xlabel("learning steps (epochs)" if against == "epochs" else "episodes while learning (mean)")
    axes.set_ylabel("success within 300 steps (%)")
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    _legend_below(axes)
    _save(figure, path)


@mpl.rc_context(STYLE)
def accumulated_reward(path: Path, systems: Mapping[str, Sequence[Outcome]], epochs: int) -> None:
    """Draw the accumulated reward over time: each seed as a thin line, the mean as a bold one (figure 11)."""
    figure, all_axes = _figure(6.4, 3.0, columns=len(systems))
    x = np.linspace(epochs / CURVE_POINTS, epochs, CURVE_POINTS)
    for axes, (name, outcomes), (colour, *_) in zip(all_axes, systems.items(), LOOKS, strict=False):
        curves = np.array([outcome.rewards for outcome in outcomes])
        axes.plot(x, curves.T, color=colour, alpha=0.3, linewidth=0.6)
        axes.plot(x, curves.mean(axis=0), color="black", linewidth=1.8)
        axes.set_title(name, fontsize=9)
        axes.set_xlabel("learning steps (epochs)")
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    all_axes[0].set_ylabel("accumulated reward (paper's units)")
    _save(figure, path)


@mpl.rc_context(STYLE)
def time_in_states(path: Path, shares: np.ndarray, names: Sequence[str]) -> None:
    """Draw the share of the learning steps in each state: mean over seeds and its 95% interval (figure 13).

    `shares` has the shape (seeds, states), in 0..1.
    """
    figure, axes = _figure(6.4, 3.0)
    means = 100 * shares.mean(axis=0)
    low, high = 100 * np.array([mean_interval(column) for column in shares.T]).T
    axes.bar(range(len(names)), means, color="#0072B2", width=0.75)
    axes.errorbar(range(len(names)), means, (means - low, high - means), fmt="none", color="black", linewidth=0.9)
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
    axes.set_xlabel("state (w, x, y, z)")
    axes.set_ylabel("share of learning steps (%)")
    axes.grid(visible=False, axis="x")
    _save(figure, path)


@mpl.rc_context(STYLE)
def table(path: Path, values: np.ndarray, names: Sequence[str]) -> None:
    """Draw the learned Q-table, states by actions, and mark the best action of each state (figure 6)."""
    figure, axes = _figure(4.6, 5.4)
    most = float(np.abs(values).max())
    image = axes.imshow(values, cmap="PuOr", vmin=-most, vmax=most, aspect="auto")
    axes.scatter(values.argmax(axis=1), range(len(values)), marker="o", s=14, facecolors="none", edgecolors="black")
    axes.set_xticks(range(len(ACTIONS)), [f"[{left:.0f},{right:.0f}]" for left, right in ACTIONS], fontsize=7)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.set_xlabel("action [left, right]; circles: the best of a state")
    axes.set_ylabel("state (w, x, y, z)")
    axes.grid(visible=False)
    figure.colorbar(image, ax=axes, label="Q (paper's units of reward)", shrink=0.8)
    _save(figure, path)


def _figure(width: float, height: float, columns: int = 1) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(1, columns)


def _legend_below(axes: Axes) -> None:
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, fontsize=8)


def _save(figure: Figure, path: Path) -> None:
    drawn = BytesIO()
    figure.savefig(drawn, format="png", metadata={"Software": None})
    write_atomic(path, drawn.getvalue())
