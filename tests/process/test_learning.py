"""Learners reach what is promised of them, with every one of 20 seeds that chose nothing."""

import json
from typing import Any

import pytest
from support import phototaxis


def trained(learner: str, percept: str, epochs: int) -> dict[str, Any]:
    """What `phototaxis train` says of the seeds 0 to 19."""
    words = ("--learner", learner, "--percept", percept, "--epochs", epochs, "--seeds", "0:20")
    done = phototaxis("train", *words, "--json", deadline=600)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [one["seed"] for one in found["seeds"]] == list(range(20))
    assert len({one["learner_hash"] for one in found["seeds"]}) == 20
    assert found["min"] == min(one["success_rate"] for one in found["seeds"])
    assert found["interval"][0] <= found["median"] <= found["interval"][1]
    print(f"{learner}, {percept}, {epochs} epochs: median {found['median']:.3f}, worst {found['min']:.3f}")
    return found


def test_the_papers_table_reaches_80_percent_in_the_median():
    assert trained("qtable", "simple", 3000)["median"] >= 0.8


@pytest.mark.parametrize(
    ("learner", "percept", "epochs", "within"),
    [
        ("mirror", "simple", 1000, "success_rate"),
        ("mirror", "simple", 3000, "within_100"),
        ("mirror", "rich", 10_000, "success_rate"),
        ("dqn", "continuous", 1000, "within_100"),
        ("dqn", "simple", 3000, "success_rate"),
    ],
)
def test_every_seed_reaches_95_percent(learner, percept, epochs, within):
    found = trained(learner, percept, epochs)
    assert min(one[within] for one in found["seeds"]) >= 0.95
    if (percept, epochs) == ("simple", 1000):
        assert found["path_ratio"] <= 3.0
