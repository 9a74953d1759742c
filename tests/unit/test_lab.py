"""Experiments: statistics that can be checked by hand, results that survive a kill, clear refusals."""

import json
from codecs import BOM_UTF8
from math import comb
from pathlib import Path

import numpy as np
import pytest
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis_lab.cell import Cell, Outcome, System, learn, run
from phototaxis_lab.experiment import Options, cells, main
from phototaxis_lab.results import Results, alone_in
from phototaxis_lab.running import seed_range
from phototaxis_lab.statistics import difference_interval, mean_interval, median_interval
from phototaxis_sim import arenas

TINY = Cell(System("qtable"), 60, 0)


def test_the_interval_of_a_median_covers_95_percent():
    values = [float(value) for value in range(20)]
    assert median_interval(values) == (5, 14)
    assert 2 * sum(comb(20, k) for k in range(6)) / 2**20 < 0.05 < 2 * sum(comb(20, k) for k in range(7)) / 2**20
    assert median_interval([3.0]) == (3, 3)
    assert median_interval([1.0, 2, 3, 4, 5]) == (1, 5)  # too few to be sure: all of them
    assert median_interval([1.0, 2, 3, 4, 5, 6]) == (1, 6)


def test_bootstrap_intervals_are_as_wide_as_theory_says():
    rng = np.random.default_rng(1)
    values, others = rng.normal(0.5, 0.1, 400), rng.normal(0.3, 0.1, 400)
    low, high = mean_interval(values.tolist())
    assert low < values.mean() < high
    assert high - low == pytest.approx(2 * 1.96 * 0.1 / 20, rel=0.1)
    low, high = difference_interval(values.tolist(), others.tolist())
    assert low < values.mean() - others.mean() < high
    assert high - low == pytest.approx(2 * 1.96 * 0.1 * 2**0.5 / 20, rel=0.1)
    assert mean_interval([0.7] * 20) == pytest.approx((0.7, 0.7))


def test_an_outcome_follows_from_its_cell():
    first = run(TINY)
    assert first == run(TINY)
    assert first.learner_hash != run(Cell(System("qtable"), 60, 1)).learner_hash
    assert len(first.rewards) == 100
    assert sum(first.visits) == 60 + first.episodes + 1  # every step's state, and each episode's last
    learned = learn(TINY)
    assert first.rewards[-1] == pytest.approx(learned.rewards.sum())
    assert set(learned.speeds.tolist()) <= {-2, -1, 0, 1, 2}


def outcome(seed: int) -> Outcome:
    return Outcome(seed, 0.5, 0.4, 20.0, 2.0, "0" * 16, 3, [1.0] * 100, [1, 2], 0.1)


def test_results_continue_where_they_were_killed(tmp_path: Path):
    grid = [Cell(System("qtable", options=(("gamma", "0.9"),)), 100, seed) for seed in range(4)]
    results = Results(tmp_path / "r", grid)
    results.add(2, outcome(2))
    results.add(0, outcome(0))
    whole = (tmp_path / "r" / "results.jsonl").read_bytes()
    (tmp_path / "r" / "results.jsonl").write_bytes(whole[:-20])  # killed while it wrote
    again = Results(tmp_path / "r", grid)
    assert again.missing == [0, 1, 3]
    again.add(0, outcome(0))
    assert Results(tmp_path / "r", grid).done == {2: outcome(2), 0: outcome(0)}


@pytest.mark.parametrize("more", [Cell(TINY.system, 60, 1), Cell(TINY.system, 61, 0), Cell(System("qlambda"), 60, 0)])
def test_a_folder_is_extended_by_more_seeds_epochs_and_systems(tmp_path: Path, more: Cell):
    Results(tmp_path, [TINY]).add(0, outcome(0))
    both = Results(tmp_path, [TINY, more])
    assert both.missing == [1]
    both.add(1, outcome(1))
    assert Results(tmp_path, [more]).done == {0: outcome(1)}
    assert Results(tmp_path, [TINY]).done == {0: outcome(0)}


def test_a_folder_has_one_experiment_at_a_time(tmp_path: Path):
    with alone_in(tmp_path / "r"), pytest.raises(Unavailable, match="another experiment computes there"):
        main(["--epochs", "50", "--seeds", "0:1", "--jobs", "1", "--out", str(tmp_path / "r")])
    with alone_in(tmp_path / "r"):
        assert not list((tmp_path / "r").iterdir())


@pytest.mark.parametrize(("text", "line"), [("garbage", "grid.json: damaged"), (None, "grid.json: missing")])
def test_results_whose_meaning_is_lost_are_refused(tmp_path: Path, text: str | None, line: str):
    Results(tmp_path, [TINY]).add(0, outcome(0))
    (tmp_path / "grid.json").unlink() if text is None else (tmp_path / "grid.json").write_text(text)
    with pytest.raises(UserError, match=line):
        Results(tmp_path, [TINY])


def test_results_that_an_editor_has_touched_are_read(tmp_path: Path):
    Results(tmp_path, [TINY]).add(0, outcome(0))
    for name in ("grid.json", "results.jsonl"):
        file = tmp_path / name
        file.write_bytes(BOM_UTF8 + file.read_bytes())
    assert Results(tmp_path, [TINY]).done == {0: outcome(0)}


def test_results_in_an_arena_that_was_changed_are_another_grids(tmp_path: Path):
    mine = tmp_path / "mine.toml"
    text = (Path(arenas.__file__).parent / "arenas" / "paper.toml").read_text()
    mine.write_text(text)
    grid = [Cell(System("qtable", arena=str(mine)), 60, 0)]
    Results(tmp_path / "r", grid)
    Results(tmp_path / "r", grid)
    mine.write_text(text.replace("brightness = 1.0", "brightness = 1.2"))
    with pytest.raises(UserError, match=r"holds results of 'qtable .*' in another arena"):
        Results(tmp_path / "r", grid)


def test_damaged_results_are_named_by_their_line(tmp_path: Path):
    Results(tmp_path, [TINY]).add(0, outcome(0))
    with (tmp_path / "results.jsonl").open("ab") as file:
        file.write(b'{"cell": 3}\n')
    with pytest.raises(UserError, match=r"results.jsonl, line 2: "):
        Results(tmp_path, [TINY])


def test_a_grid_is_every_combination():
    found = cells(
        Options(learners="qtable,ann", percepts="simple,rich", epochs="10,20", seeds="3:6", set=["gamma=0.4"])
    )
    assert len(found) == len(set(found)) == 2 * 2 * 2 * 3
    assert {cell.system.setup().hyperparameters.gamma for cell in found} == {0.4}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--learners", "qtabel"], "no learner 'qtabel'; did you mean qtable[?] there are: ann, .*qtable"),
        (["--percepts", "richer"], "percept richer: no such percept; did you mean rich[?] there are: simple, rich"),
        (
            ["--learners", "mirror", "--percepts", "continuous"],
            "--percept continuous: .*countable states: simple, rich",
        ),
        (["--rewards", "gold"], "reward gold: no such reward; there are: own, difference, static, potential"),
        (["--epochs", "300,0"], "--epochs 0: expected whole numbers above 0"),
        (["--seeds", "4:4"], "--seeds 4:4: no seed from 4 to 4"),
        (["--seeds", "4"], "--seeds 4: expected A:B, the seeds from A to B − 1, as in 0:20"),
        (["--set", "percept=rich"], "--set percept=rich: give it as --percepts rich"),
        (["--set", "gamma"], "--set gamma: expected NAME=VALUE"),
        (["--set", "gamma=2"], "gamma 2: expected a number below 1.0, as in 0.75"),
        (["--set", "gama=0.2"], "no option 'gama' of the learner qtable; did you mean gamma[?] there are: .*gamma"),
        (["--arena", "atlantis"], "atlantis"),
        (["--backend", "dask"], "--backend dask needs the address of a scheduler"),
        (["--out", "/proc/nothing"], "/proc/nothing: "),
    ],
)
def test_what_does_not_fit_is_one_line_before_anything_is_computed(tmp_path: Path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=message) as caught:
        main(words)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.rglob("results.jsonl"))


def test_seeds_are_half_open():
    assert list(seed_range("3:6")) == [3, 4, 5]


def test_an_experiment_in_one_process(tmp_path: Path, capsys):
    words = [
        "--learners",
        "qtable,mirror",
        "--epochs",
        "50,80",
        "--seeds",
        "0:2",
        "--out",
        str(tmp_path),
        "--jobs",
        "1",
    ]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["systems"]
    assert [(one["system"], one["epochs"]) for one in found] == [
        ("qtable simple", 50), ("qtable simple", 80), ("mirror simple", 50), ("mirror simple", 80),
    ]  # fmt: skip
    assert all(one["interval"][0] <= one["median"] <= one["interval"][1] for one in found)
    assert main(words) == 0
    said = capsys.readouterr()
    assert "8 of 8 are done already" in said.err
    assert "mirror simple" in said.out
