"""`phototaxis reproduce`: repeats the paper's experiments, and writes a page of claims, measurements and figures."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path

from phototaxis.runtime.disk import check_folder_writable, make_folder
from phototaxis.runtime.options import parse

from phototaxis_lab.running import SEEDS, Running, seed_range


class Options(Running, kw_only=True):
    """Options of `phototaxis reproduce`."""

    seeds: SEEDS = "0:20"
    """A:B: the seeds from A to B − 1"""
    results: str = "runs/reproduction"
    """folder of the results; the same command continues an interrupted reproduction there"""
    out: str = "docs/reproduction"
    """folder for the page and its figures"""


def main(argv: Sequence[str]) -> int:
    about = "Run the paper's experiments and further ones, and write the page with a verdict on each of its claims."
    options = parse(Options, argv, "phototaxis reproduce", about)
    seeds, out = seed_range(options.seeds), Path(options.out)
    from phototaxis_lab.grid import by_system, compute
    from phototaxis_lab.reproduction import page, plan

    check_folder_writable(out, "--out")
    check_folder_writable(Path(options.results), "--results")
    parts = {part: plan.cells(planned, seeds) for part, planned in plan.PARTS.items()}
    parts["fresh"] = plan.cells(plan.FRESH, plan.fresh_seeds(seeds))
    found = {}
    for number, (part, cells) in enumerate(parts.items(), start=1):
        began = time.monotonic()
        print(f"{part}, {number} of {len(parts)} parts", file=sys.stderr)
        found[part] = by_system(compute(cells, Path(options.results) / part, options))
        print(f"{part}: {(time.monotonic() - began) / 60:.1f} minutes", file=sys.stderr)
    whole = found["paper"] | found["beyond"]
    data = {
        name: {epochs: whole[system, epochs] for epochs in budgets} for name, (system, budgets) in plan.WHOLE.items()
    }
    print("writing the page and its figures", file=sys.stderr)
    make_folder(out)
    page.write(out, data, found["fresh"], seeds)
    print(out / "README.md")
    return 0
