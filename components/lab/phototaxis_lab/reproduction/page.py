"""Writes the page of results: claims and verdicts, figures, tables of all systems, and hyperparameters."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from string import Template

import msgspec
import numpy as np
from phototaxis.runtime.disk import write_atomic
from phototaxis.task import FORWARD, PERCEPTS
from phototaxis_sim import arenas

from phototaxis_lab.cell import PLACEMENTS, Cell, Outcome, System, learn
from phototaxis_lab.controllers import Braitenberg, Random
from phototaxis_lab.measure import Drive, Evaluation, measure
from phototaxis_lab.reproduction import figures
from phototaxis_lab.reproduction.claims import CLAIMS, Data, between, state_shares
from phototaxis_lab.reproduction.plan import (
    BEYOND,
    DISCOUNTS,
    EXCHANGED,
    PAPER,
    PROPOSED,
    SHADOWS,
    WHOLE,
    Plan,
    fresh_seeds,
)
from phototaxis_lab.statistics import mean_interval, median_interval

TUNING = "100 to 460"
"""The seeds on which the hyperparameters were chosen."""


Fresh = Mapping[tuple[System, int], Sequence[Outcome]]
"""Outcomes of each system and number of epochs on the seeds of `fresh_seeds`."""


def write(folder: Path, data: Data, fresh: Fresh, seeds: range) -> None:
    """Write `README.md` and the figures into `folder`."""
    fixed = {arena: controllers(arena, seeds) for arena in ("paper", "shadows")}
    draw(folder, data, seeds, fixed["paper"])
    template = Template(Path(__file__).with_name("page.md").read_text(encoding="utf-8"))
    text = template.substitute(
        first=seeds.start,
        last=seeds.stop - 1,
        tuning=TUNING,
        claims=claims_table(data),
        systems=systems_table({**PAPER, **EXCHANGED, **DISCOUNTS, **PROPOSED, **BEYOND}, data, fixed["paper"]),
        shadows=systems_table(SHADOWS, data, fixed["shadows"]),
        hyperparameters=hyperparameters(),
        fresh=fresh_table(fresh),
        fresh_first=fresh_seeds(seeds).start,
        fresh_last=fresh_seeds(seeds).stop - 1,
    )
    write_atomic(folder / "README.md", text.encode())


def controllers(name: str, seeds: range) -> dict[str, list[Evaluation]]:
    """Measure the controllers that do not learn, on the same placements as the learners."""
    arena = arenas.load(name)
    kinds: dict[str, Callable[[int], Drive]] = {
        "random, 9 actions": lambda seed: Random(range(9), seed),
        "random, 6 forward actions": lambda seed: Random(FORWARD, seed),
        "Braitenberg, hand-written": lambda _: Braitenberg(arena.sensing.near),
    }
    return {kind: [measure(arena, make(seed), PLACEMENTS, seed) for seed in seeds] for kind, make in kinds.items()}


def draw(folder: Path, data: Data, seeds: range, fixed: Mapping[str, Sequence[Evaluation]]) -> None:
    """Draw all figures."""
    levels = {
        "random actions": fixed["random, 9 actions"],
        "hand-written controller": fixed["Braitenberg, hand-written"],
    }
    lines = {name: float(np.mean([one.success_rate for one in found])) for name, found in levels.items()}
    simple = {name: data[name] for name in ("Q-table, simple", "net, simple")}
    rich = {name: data[name] for name in ("Q-table, rich", "net, rich")}
    beyond = {name: data[name] for name in ("mirror, simple", "qlambda, simple", "dqn, simple", "Q-table, simple")}
    for against in ("epochs", "episodes"):
        figures.success(folder / f"simple-{against}.png", simple, {**lines, "the paper's 80%": 0.8}, against)
        figures.success(folder / f"rich-{against}.png", rich, {**lines, "the paper's 30%": 0.3}, against)
    figures.success(folder / "beyond-epochs.png", beyond, lines)
    figures.accumulated_reward(folder / "reward.png", {name: runs[30_000] for name, runs in rich.items()}, 30_000)
    states = ["".join(map(str, state)) for state in np.ndindex(*PERCEPTS["simple"].sizes)]
    figures.time_in_states(folder / "states.png", state_shares(data["Q-table, simple"][3000]), states)
    agent = learn(Cell(PAPER["Q-table, simple"][0], 3000, seeds.start)).agent
    figures.table(folder / "table.png", np.reshape(agent.table(), (len(states), -1)), states)


def claims_table(data: Data) -> str:
    """Return the table of claims, one row for each."""
    rows = ["| | claim | section | measured | verdict | why |", "|--:|---|---|---|---|---|"]
    for number, claim in enumerate(CLAIMS, start=1):
        found = claim.judge(data)
        rows.append(
            f"| {number} | {claim.says} | {claim.section} | {found.measured} | **{found.verdict}** | {found.why} |"
        )
    return "\n".join(rows)


def systems_table(plan: Plan, data: Data, fixed: Mapping[str, Sequence[Evaluation]]) -> str:
    """Return a table with rows for the controllers that do not learn, then for each system and number of epochs."""
    rows = [
        "| system | reward | epochs | median [95%] | worst | mean [95%] | worst in 100 | path ratio | seeds ≥ 95% |",
        "|---|---|--:|---|--:|---|--:|--:|--:|",
    ]
    for name, found in fixed.items():
        rows.append(f"| *{name}* | | | {_columns(found)} |")
    for name, (system, budgets) in plan.items():
        reward = system.setup().task.scheme().scheme
        for epochs in budgets:
            rows.append(f"| {name} | {reward} | {epochs:,} | {_columns(data[name][epochs])} |")
    return "\n".join(rows)


def _columns(found: Sequence[Outcome] | Sequence[Evaluation]) -> str:
    success = [one.success_rate for one in found]
    ratios = [one.path_ratio for one in found if one.path_ratio is not None]
    good = sum(rate >= 0.95 for rate in success)
    return " | ".join(
        (
            f"{np.median(success):.1%} {between(median_interval(success))}",
            f"{min(success):.1%}",
            f"{np.mean(success):.1%} {between(mean_interval(success))}",
            f"{min(one.within_100 for one in found):.1%}",
            f"{np.median(ratios):.2f}" if ratios else "",
            f"{good} of {len(success)}",
        )
    )


def fresh_table(fresh: Fresh) -> str:
    """Return a table with one row for each system and its five worst seeds."""
    rows = ["| learner, percept | epochs | median [95%] | seeds ≥ 95% | worst five seeds |", "|---|--:|---|--:|---|"]
    for (system, epochs), found in fresh.items():
        rates = [one.success_rate for one in found]
        worst = ", ".join(f"{one.success_rate:.1%} ({one.seed})" for one in sorted(found, key=_success)[:5])
        good = sum(rate >= 0.95 for rate in rates)
        median = f"{np.median(rates):.1%} {between(median_interval(rates))}"
        name = f"{system.learner}, {system.percept}"
        rows.append(f"| {name} | {epochs:,} | {median} | {good} of {len(rates)} | {worst} |")
    return "\n".join(rows)


def _success(outcome: Outcome) -> float:
    return outcome.success_rate


def hyperparameters() -> str:
    """What every system of the page learnt with."""
    rows = ["| learner, percept, reward | hyperparameters |", "|---|---|"]
    seen = set()
    for system, _ in WHOLE.values():
        setup = system.setup()
        options = msgspec.to_builtins(setup.hyperparameters) | msgspec.to_builtins(setup.exploration)
        options["max_episode_steps"] = setup.task.max_episode_steps
        words = ", ".join(
            f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}" for name, value in options.items()
        )
        row = f"| {setup.learner}, {setup.task.percept}, {setup.task.scheme().scheme} | {words} |"
        if row not in seen:
            seen.add(row)
            rows.append(row)
    return "\n".join(rows)
