"""The default agent does what the paper says: upwards of 80% after 3,000 epochs."""

import json

from support import phototaxis


def test_the_median_of_20_seeds_reaches_80_percent():
    done = phototaxis("train", "--seeds", "0:20", "--epochs", 3000, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    print(f"median {found['median']:.3f}, worst {found['min']:.3f}")
    assert len(found["seeds"]) == 20
    assert found["median"] >= 0.8
    assert all(0 <= one["success_rate"] <= 1 for one in found["seeds"])
    assert len({one["learner_hash"] for one in found["seeds"]}) == 20
