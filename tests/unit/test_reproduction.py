"""The page of the reproduction: verdicts follow from the numbers, and every part of it is there."""

from pathlib import Path

import numpy as np
import pytest
from phototaxis_lab.cell import Outcome, System
from phototaxis_lab.reproduction import claims, page, plan
from phototaxis_lab.statistics import Interval
from PIL import Image

SEEDS = range(6)


def outcome(seed: int, success: float, states: int = 24, rewards: np.ndarray | None = None) -> Outcome:
    """A made-up outcome around a success rate."""
    rng = np.random.default_rng(seed)
    found = float(np.clip(success + rng.normal(0, 0.02), 0, 1))
    curve = np.arange(100.0) if rewards is None else rewards
    visits = rng.integers(1, 9, states).tolist()
    return Outcome(seed, found, found / 2, 30.0, 3.0, f"{seed:016x}", 40, curve.tolist(), visits, 0.2)


def made_up(success: dict[str, float]) -> dict[str, dict[int, list[Outcome]]]:
    """Data for the whole plan: some systems with a success rate of their own, the others with 0.5."""
    return {
        name: {
            epochs: [outcome(seed, success.get(name, 0.5), 400 if system.percept == "rich" else 24) for seed in SEEDS]
            for epochs in budgets
        }
        for name, (system, budgets) in plan.WHOLE.items()
    }


def made_up_fresh() -> dict[tuple[System, int], list[Outcome]]:
    """Outcomes on fresh seeds, of which one is bad."""
    seeds = plan.fresh_seeds(SEEDS)
    return {
        (system, epochs): [outcome(seed, 0.2 if seed == seeds[7] else 1.1) for seed in seeds]
        for system, (epochs,) in plan.FRESH.values()
    }


@pytest.mark.parametrize(
    ("intervals", "verdict"),
    [
        ([Interval(0.1, 0.2), Interval(0.05, 0.3)], "confirmed"),
        ([Interval(0.1, 0.2), Interval(-0.05, 0.3)], "undecided"),
        ([Interval(0.1, 0.2), Interval(-0.3, -0.1)], "refuted"),
    ],
)
def test_a_verdict_follows_from_the_intervals(intervals, verdict):
    assert claims.decide(intervals) == verdict


@pytest.mark.parametrize(
    ("judge", "success", "verdict"),
    [
        (claims.table_sizes, {}, "confirmed"),
        (claims.simple_table, {"Q-table, simple": 0.9}, "confirmed"),
        (claims.simple_table, {"Q-table, simple": 0.6}, "refuted"),
        (claims.simple_net_is_worse, {"Q-table, simple": 0.9}, "confirmed"),
        (claims.simple_net_is_worse, {"Q-table, simple": 0.1}, "refuted"),
        (claims.simple_net_is_worse, {}, "undecided"),
        (claims.rich_is_not_learnt, {"Q-table, rich": 0.1, "net, rich": 0.2}, "confirmed"),
        (claims.rich_is_not_learnt, {"Q-table, rich": 0.1, "net, rich": 0.4}, "refuted"),
        (claims.rich_net_is_better, {"net, rich": 0.7}, "confirmed"),
        (claims.linear_is_better, {"linear net, simple": 0.7, "linear net, rich": 0.7}, "confirmed"),
        (claims.linear_is_better, {"linear net, simple": 0.7}, "undecided"),
        (claims.net_per_action_is_faster, {"net per action, rich": 0.2}, "refuted"),
        (claims.elman, {"Elman net, simple": 0.7, "Elman net, rich": 0.7}, "confirmed"),
    ],
)
def test_claims_are_judged_by_the_data(judge, success, verdict):
    found = judge(made_up(success))
    assert found.verdict == verdict
    assert found.measured
    assert found.why


def test_haphazard_rewards_are_rougher_than_steady_ones():
    steady, wild = np.arange(100.0), np.cumsum(np.random.default_rng(0).normal(size=100))
    assert claims.roughness([outcome(0, 0.5, rewards=steady)])[0] < claims.roughness([outcome(0, 0.5, rewards=wild)])[0]


def test_time_in_states_is_judged_by_the_three_most_met():
    data = made_up({})
    for one in data["Q-table, simple"][3000]:
        one.visits = [1] * 24
        for state in claims.CROWDED:
            one.visits[int(np.ravel_multi_index(state, (3, 2, 2, 2)))] = 50
    assert claims.time_piles_up(data).verdict == "confirmed"
    for one in data["Q-table, simple"][3000]:
        one.visits[23] = 99
    assert claims.time_piles_up(data).verdict == "refuted"


def test_the_page_has_every_claim_system_and_figure(tmp_path: Path):
    page.write(tmp_path, made_up({}), made_up_fresh(), SEEDS)
    text = (tmp_path / "README.md").read_text()
    assert "$" not in text.replace("```sh", "")
    assert all(claim.says in text for claim in claims.CLAIMS)
    assert len(claims.CLAIMS) == 11
    assert all(f"| {name} |" in text for name in plan.WHOLE)
    assert "Braitenberg" in text
    row = next(line for line in text.splitlines() if line.startswith("| mirror, rich | 10,000 |"))
    assert "29 of 30" in row
    assert "(1007)" in row.split("|")[5].split(",")[0]
    for figure in tmp_path.glob("*.png"):
        assert f"({figure.name})" in text
        with Image.open(figure) as image:
            assert min(image.size) > 400
    assert len(list(tmp_path.glob("*.png"))) == 8
