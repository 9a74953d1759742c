"""Experiments as processes: killed and continued, on a cluster, and with what goes wrong there."""

import json
import re
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster
from support import DEADLINE, Process, command, phototaxis

GRID = ("experiment", "--learners", "qtable,qlambda", "--epochs", 600, "--seeds", "0:6", "--jobs", 2, "--json")


def systems(stdout: str) -> list[dict]:
    return json.loads(stdout.splitlines()[-1])["systems"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> list[dict]:
    """The grid, computed without a disturbance."""
    done = phototaxis(*GRID, "--out", tmp_path_factory.mktemp("whole"))
    assert done.returncode == 0, done.stderr
    return systems(done.stdout)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_experiment_continues(tmp_path: Path, whole, number):
    out = tmp_path / "r"
    first = Process(tmp_path, "first", *command(*GRID, "--out", out))
    lines, deadline = out / "results.jsonl", time.monotonic() + DEADLINE
    while not lines.exists() or lines.read_bytes().count(b"\n") < 3:
        first.alive()
        assert time.monotonic() < deadline, first.stderr
    first.popen.send_signal(number)
    assert first.end() == {signal.SIGKILL: -9, signal.SIGINT: 130}[number]
    assert "Traceback" not in first.stderr
    again = phototaxis(*GRID, "--out", out)
    assert again.returncode == 0, again.stderr
    kept = re.search(r"(\d+) of 12 are done already", again.stderr)
    assert kept
    assert 3 <= int(kept[1]) < 12
    assert systems(again.stdout) == whole
    assert lines.read_bytes().count(b"\n") == 12


def test_the_same_command_runs_on_a_cluster(tmp_path: Path, whole):
    cluster: Any
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1") as cluster:
        words = ("--backend", "dask", "--scheduler", cluster.scheduler_address)
        done = phototaxis(*GRID, "--out", tmp_path / "r", *words)
    assert done.returncode == 0, done.stderr
    assert systems(done.stdout) == whole


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense"])
def test_a_cluster_that_cannot_be_reached_is_one_line(tmp_path: Path, address):
    done = phototaxis(*GRID, "--out", tmp_path / "r", "--backend", "dask", "--scheduler", address)
    assert done.returncode == 3
    assert re.fullmatch(
        rf"phototaxis: error: --scheduler {address}: no Dask scheduler answers there: .*", done.stderr[:-1]
    )
    assert not (tmp_path / "r").exists()


def test_one_seed_after_another_or_together(whole):
    done = phototaxis("train", "--seeds", "0:6", "--epochs", 600, "--json")
    found = json.loads(done.stdout)
    for key in ("median", "min", "interval", "mean"):
        assert found[key] == whole[0][key]
    assert list(found["seeds"][0]) == ["seed", "success_rate", "within_100", "steps_mean", "path_ratio", "learner_hash"]
    alone = phototaxis("train", "--seed", 4, "--epochs", 600, "--json")
    assert json.loads(alone.stdout)["learner_hash"] == found["seeds"][4]["learner_hash"]
