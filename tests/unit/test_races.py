"""What starts at the same moment gets files of its own."""

import os
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import msgspec
import numpy as np
import pytest
from phototaxis.runtime import checkpoint
from phototaxis.runtime.component import unique_name
from phototaxis.runtime.errors import UserError
from phototaxis.wire.messages import World
from phototaxis_launcher import folder
from phototaxis_recorder import recordings
from phototaxis_recorder.file import fresh_file

MANY = 8


def together(work):
    """What `work` returns in each of many threads that begin at the same moment."""
    begin = Barrier(MANY)

    def one(number):
        begin.wait(10)
        return work(number)

    with ThreadPoolExecutor(MANY) as pool:
        return list(pool.map(one, range(MANY)))


def test_runs_that_have_the_same_name_have_two_folders(tmp_path, monkeypatch):
    names = iter(["one", "one", "two"])
    monkeypatch.setattr(folder, "run_name", lambda: next(names))
    assert [folder.RunFolder(tmp_path / "runs").path.name for _ in range(2)] == ["one", "two"]


def test_runs_that_start_together_have_folders_of_their_own(tmp_path):
    assert len(set(together(lambda _: folder.RunFolder(tmp_path / "runs").path))) == MANY


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match=r"--out .*/file: Not a directory"):
        folder.RunFolder(tmp_path / "file")


def test_recorders_that_start_together_have_files_of_their_own(tmp_path):
    found = together(lambda _: fresh_file(tmp_path / "recording.rrd").name)
    assert sorted(found) == sorted(["recording.rrd", *(f"recording-{number}.rrd" for number in range(2, MANY + 1))])


def test_a_checkpoint_that_many_write_is_one_of_theirs(tmp_path, setup, paper):
    path = tmp_path / "c.npz"
    meta, _ = setup.agent(World(run="r", arena=paper, seed=0, epochs=0)).checkpoint()

    def save(number):
        arrays = {"values": np.full(100_000, float(number))}
        whole = msgspec.structs.replace(meta, learner_hash=checkpoint.learner_hash(arrays))
        for _ in range(5):
            checkpoint.save(path, whole, arrays)
            checkpoint.load(path)

    together(save)
    assert [file.name for file in tmp_path.iterdir()] == ["c.npz"]


def test_names_on_the_bus_differ():
    assert len({unique_name("agent") for _ in range(500)}) == 500
    assert len(unique_name("a-learner-with-a-long-name")) == 24


def test_what_somebody_else_has_removed_is_removed(tmp_path, monkeypatch):
    file = tmp_path / "old.rrd"
    file.write_bytes(b"RRF")
    os.utime(file, (0, 0))
    found = recordings.recordings(tmp_path)
    monkeypatch.setattr(recordings, "recordings", lambda _: found)
    for _ in range(2):
        assert recordings.main([f"--out={tmp_path}", "--max-age=1"]) == 0
    assert not file.exists()
