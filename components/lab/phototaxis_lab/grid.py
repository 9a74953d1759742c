"""Computes many cells, and summarises their outcomes."""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from phototaxis_lab.cell import Cell, Outcome, System
from phototaxis_lab.parallel import cluster, outcomes
from phototaxis_lab.progress import Progress
from phototaxis_lab.results import Results, alone_in
from phototaxis_lab.running import Running
from phototaxis_lab.statistics import mean_interval, median_interval


def compute(cells: Sequence[Cell], folder: Path, running: Running) -> Results:
    """Compute the outcomes of all cells, except those that the folder already holds."""
    with cluster(running.backend, running.scheduler), alone_in(folder):
        results = Results(folder, cells)
        missing = results.missing
        if found := len(cells) - len(missing):
            print(f"{folder}: {found} of {len(cells)} are done already", file=sys.stderr)
        for place, outcome in with_progress([cells[index] for index in missing], running):
            results.add(missing[place], outcome)
    return results


def with_progress(cells: Sequence[Cell], running: Running) -> Iterable[tuple[int, Outcome]]:
    """Compute cells as `parallel.outcomes` does, and show the progress in epochs; call it within a `cluster`."""
    if cells:
        print(f"agents to train and measure: {len(cells)}", file=sys.stderr, flush=True)
    progress = Progress(sum(cell.epochs for cell in cells), "epochs")
    with progress:
        for index, outcome in outcomes(cells, running.jobs):
            yield index, outcome
            progress.add(cells[index].epochs)


def by_system(results: Results) -> dict[tuple[System, int], list[Outcome]]:
    """Group the outcomes by system and number of epochs, in the order of the grid."""
    found: dict[tuple[System, int], list[Outcome]] = {}
    for index, cell in enumerate(results.cells):
        if index in results.done:
            found.setdefault((cell.system, cell.epochs), []).append(results.done[index])
    return found


def summarise(results: Results) -> list[dict[str, Any]]:
    """Return a summary as plain data for each system and number of epochs."""
    return [
        {"system": str(system), "epochs": epochs, **summary(of_seeds)}
        for (system, epochs), of_seeds in by_system(results).items()
    ]


def summary(of_seeds: Sequence[Outcome]) -> dict[str, Any]:
    """Summarise outcomes over seeds: median and mean success with 95% intervals, worst success, median path ratio."""
    rates = [outcome.success_rate for outcome in of_seeds]
    ratios = [outcome.path_ratio for outcome in of_seeds if outcome.path_ratio is not None]
    return {
        "median": float(np.median(rates)),
        "min": min(rates),
        "interval": list(median_interval(rates)),
        "mean": float(np.mean(rates)),
        "mean_interval": list(mean_interval(rates)),
        "within_100_min": min(outcome.within_100 for outcome in of_seeds),
        "path_ratio": float(np.median(ratios)) if ratios else None,
        "at_least_95_percent": float(np.mean(np.array(rates) >= 0.95)),
    }


def describe(summaries: Sequence[dict[str, Any]]) -> str:
    """Format summaries as a table in plain text."""
    width = max(len(one["system"]) for one in summaries)
    lines = [f"{'':{width}}  {'epochs':>7}  success: median [95% interval]    worst   mean  path ratio"]
    for one in summaries:
        low, high = one["interval"]
        ratio = "" if one["path_ratio"] is None else f"{one['path_ratio']:.1f}"
        lines.append(
            f"{one['system']:{width}}  {one['epochs']:7}  {one['median']:15.1%} [{low:.1%}, {high:.1%}]"
            f"{one['min']:9.1%} {one['mean']:6.1%}  {ratio:>10}"
        )
    return "\n".join(lines)
