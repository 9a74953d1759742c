"""The test of the test: a defect that is put into a machine makes a schedule fail."""

import pytest

from simulated.mutations import MUTATIONS
from simulated.runs import run
from simulated.schedule import make

SEEDS = 200


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.about)
def test_a_defect_is_caught(mutation, monkeypatch, capsys):
    monkeypatch.setattr(mutation.where, mutation.name, mutation.make(getattr(mutation.where, mutation.name)))
    for seed in range(SEEDS):
        wrong = run(make(seed)).wrong
        if wrong.startswith("Broken"):
            with capsys.disabled():
                print(f"\n{mutation.about}: seed {seed}, {wrong}")
            return
    pytest.fail(f"{SEEDS} schedules did not notice that the system {mutation.about}")
