"""Two worlds may have one name: what is kept of a world is its digest, and whoever goes on elsewhere is told."""

import json
from pathlib import Path

import msgspec
import numpy as np
import pytest
from phototaxis.geometry.arena import Arena
from phototaxis.runtime import checkpoint, errors
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.journal import Journal
from phototaxis.wire.messages import World
from phototaxis_agent.setup import make_setup
from phototaxis_lab import evaluate
from phototaxis_recorder.recordings import table
from phototaxis_recorder.summary import RecordingFile, Summary
from phototaxis_sim.continued import Continued, open_journal
from phototaxis_sim.simulation import Simulation

MINE = """
name = "{}"
size = [12.0, 12.0]
[[lights]]
position = [2.0, 10.0]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """The working folder, with `paper.toml` (another world than the shipped one) and `mine.toml` (the same world)."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(errors, "_said", set())
    for name in ("paper", "mine"):
        (tmp_path / f"{name}.toml").write_text(MINE.format(name))
    return tmp_path


def learned(arena: str) -> None:
    """Leave `c.npz`, of an agent that learned in an arena."""
    from phototaxis_sim import arenas

    agent = make_setup().agent(World(run="r", arena=arenas.load(arena), seed=0, epochs=10))
    checkpoint.save(Path("c.npz"), *agent.checkpoint())


def measured(*words: str) -> int:
    return evaluate.main(["c.npz", "--placements=3", "--max-episode-steps=2", *words])


def test_a_changed_copy_of_a_shipped_arena_is_not_taken_for_it(folder):
    learned("paper.toml")
    with pytest.raises(UserError, match=r"c.npz: learned in the arena 'paper' \(\w{16}\), .* another world") as error:
        measured()
    assert "--arena" in str(error.value)


def test_an_evaluation_says_where_it_measures(folder, capsys):
    learned("paper.toml")
    assert measured("--arena=mine.toml", "--json") == 0  # another name, and the same world
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["arena"], found["learned_in"]) == ("mine.toml", "paper")
    assert found["arena_digest"] == found["learned_in_digest"]
    assert err == ""
    assert measured("--arena=paper") == 0
    out, err = capsys.readouterr()
    assert "measured in the arena 'paper'" in out
    assert err.startswith("phototaxis: warning: c.npz: learned in the arena 'paper'")
    assert err.count("\n") == 1


def test_a_shipped_arena_needs_no_option(folder, capsys):
    learned("doorway")
    assert measured() == 0
    out, err = capsys.readouterr()
    assert "measured in the arena 'doorway'" in out
    assert err == ""


def rewritten(change) -> None:
    """Change the text of `c.npz`."""
    with np.load("c.npz") as stored:
        arrays = dict(stored)
    meta = json.loads(arrays.pop("meta").tobytes())
    change(meta)
    np.savez("c.npz", meta=np.frombuffer(json.dumps(meta).encode(), np.uint8), **arrays)


@pytest.mark.parametrize(("written", "age"), [(1, "an older"), (2, "an older"), (99, "a newer")])
def test_a_checkpoint_of_another_format_is_refused_in_one_line(folder, written, age):
    learned("paper")
    rewritten(lambda meta: meta.update(format=written, more=1))
    with pytest.raises(UserError) as refused:
        checkpoint.load(Path("c.npz"))
    assert str(refused.value) == f"c.npz: made by {age} version (checkpoint format {written}, not 3); train again"


def test_an_agent_that_meets_another_world_goes_on_there(paper: Arena):
    agent = make_setup().agent(World(run="r", arena=paper, seed=0, epochs=10))
    other = msgspec.structs.replace(paper, name="other", sensing=msgspec.structs.replace(paper.sensing, near=0.7))
    agent.enter(other)
    meta, _ = agent.checkpoint()
    assert (meta.arena, meta.arena_digest) == ("other", other.digest)
    assert agent.policy.near == 0.7


def test_recordings_of_two_worlds_with_one_name_are_told_apart():
    summaries = [Summary("a", "paper", "12345678"), Summary("b", "paper", "abcdefgh"), Summary("c", "mine", "1")]
    lines = table([RecordingFile(Path(one.run), 1, 0.0, one) for one in summaries])
    assert "paper (1234)" in lines[1]
    assert "paper (abcd)" in lines[2]
    assert "mine " in lines[3]
    assert "mine (" not in lines[3]


def test_a_run_is_not_continued_in_another_world(paper: Arena, tmp_path: Path):
    def begin(arena: Arena) -> Continued | None:
        return open_journal(Journal(tmp_path / "journal"), Simulation(arena, 0, "r"))

    assert begin(paper) is None
    assert begin(msgspec.structs.replace(paper, name="renamed")) is not None
    with pytest.raises(UserError, match="the run r began in another arena"):
        begin(msgspec.structs.replace(paper, size=(10.0, 12.0)))
