"""A full, limited or unwritable disk: told before the work begins, in one line, and no file is ever left in part."""

import json
import os
from pathlib import Path

import pytest
from disks import no_file_larger_than
from phototaxis.runtime.disk import check_folder_writable, check_writable, write_atomic
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.journal import GIVEN_UP, Journal
from phototaxis_lab import train
from phototaxis_lab.cell import Cell, Outcome, System
from phototaxis_lab.results import Results


@pytest.mark.parametrize("try_place", [check_writable, check_folder_writable])
def test_a_place_that_takes_nothing_is_told_before_the_work_begins(tmp_path: Path, try_place):
    with no_file_larger_than(100), pytest.raises(Unavailable, match=r"--out .*/x: File too large; free some space"):
        try_place(tmp_path / "x", "--out")
    try_place(tmp_path / "x", "--out")
    assert not list(tmp_path.iterdir())


def test_a_place_that_is_none_is_bad_input(tmp_path: Path):
    (tmp_path / "file").write_text("kept")
    for path, line in (
        (tmp_path / "no" / "x", "there is no folder"),
        (tmp_path, "Is a directory"),
        (tmp_path / ("x" * 300), "File name too long"),
    ):
        with pytest.raises(UserError, match=line) as found:
            check_writable(path, "--out")
        assert found.value.exit_code == 2
    with pytest.raises(UserError, match=r"--out .*: Not a directory"):
        check_folder_writable(tmp_path / "file" / "x", "--out")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_trial_changes_nothing(tmp_path: Path):
    file = tmp_path / "x"
    file.write_text("old")
    check_writable(file, "--out")
    check_folder_writable(tmp_path, "--out")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("x", "old")]


def test_an_old_file_outlives_a_new_one_that_does_not_fit(tmp_path: Path):
    file = tmp_path / "x"
    write_atomic(file, b"old")
    with no_file_larger_than(100), pytest.raises(Unavailable, match=r"/x: File too large"):
        write_atomic(file, bytes(200))
    assert file.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_links_and_devices_stay_what_they_are(tmp_path: Path):
    target, link = tmp_path / "target", tmp_path / "link"
    link.symlink_to(target)
    check_writable(link, "--out")
    write_atomic(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    device = tmp_path / "device"
    device.symlink_to("/dev/full")
    for write in (lambda: check_writable(device, "--out"), lambda: write_atomic(device, b"new")):
        with pytest.raises(Unavailable, match="No space left on device"):
            write()
    assert os.path.realpath(device) == "/dev/full"
    assert not Path("/dev/full").is_file()


def test_an_entry_that_does_not_fit_is_undone_and_later_ones_are_read(tmp_path: Path):
    journal = Journal(tmp_path / "j")
    journal.begin(b"head")
    with no_file_larger_than(100):
        journal.append(b"a" * 40)
        for _ in range(2):
            with pytest.raises(OSError, match=r"File too large.*/j"):
                journal.append(b"b" * 60)
        journal.append(b"c")
    journal.append(b"d")
    assert journal.read() == [b"head", b"a" * 40, b"c", b"d"]


def test_a_journal_that_cannot_be_begun_anew_stays_as_it_was(tmp_path: Path):
    journal = Journal(tmp_path / "j")
    journal.begin(b"head")
    with no_file_larger_than(100), pytest.raises(OSError, match=r"File too large.*/j"):
        journal.begin(bytes(200))
    journal.append(b"a")
    assert journal.read() == [b"head", b"a"]
    assert [path.name for path in tmp_path.iterdir()] == ["j"]


def test_a_journal_that_is_given_up_says_so_until_it_is_begun_anew(tmp_path: Path):
    journal = Journal(tmp_path / "j")
    journal.begin(b"head")
    journal.append(b"a")
    with no_file_larger_than(journal.path.stat().st_size):
        with pytest.raises(OSError, match="File too large"):
            journal.append(b"b")
        journal.give_up()
    assert not journal.kept
    assert journal.read() == [b"head", GIVEN_UP]
    journal.begin(b"again")
    journal.append(b"c")
    assert journal.kept
    assert journal.read() == [b"again", b"c"]


def test_a_resumed_journal_goes_on_after_what_was_torn(tmp_path: Path):
    path = tmp_path / "j"
    first = Journal(path)
    first.begin(b"head")
    for entry in (b"one", b"two"):
        first.append(entry)
    path.write_bytes(path.read_bytes()[:-2])
    again = Journal(path)
    again.resume(again.read())
    again.append(b"three")
    assert again.read() == [b"head", b"one", b"three"]
    again.give_up()
    assert again.read() == [b"head", GIVEN_UP]


def test_a_journal_without_room_for_the_mark_is_removed(tmp_path: Path):
    journal = Journal(tmp_path / "j")
    journal.begin(b"head")
    with no_file_larger_than(journal.path.stat().st_size):
        journal.give_up()
    assert journal.read() == []


def test_what_is_no_journal_is_not_taken_for_an_empty_one(tmp_path: Path):
    notes = tmp_path / "notes"
    notes.write_text("all that I know of light")
    damaged = Journal(tmp_path / "j")
    damaged.begin(b"head")
    damaged.append(b"one")
    damaged.append(b"two")
    data = bytearray(damaged.path.read_bytes())
    data[-12] ^= 1  # within "one"
    damaged.path.write_bytes(data)
    for path in (notes, damaged.path, tmp_path):
        with pytest.raises(UserError, match=f"{path.name}: (not a journal|.*damaged at byte 12|Is a directory)"):
            Journal(path).read()


def test_what_was_learned_is_told_before_it_cannot_be_saved(tmp_path: Path, capsys):
    file = tmp_path / "c.npz"
    file.write_bytes(b"older")
    words = ["--epochs", "30", "--percept", "rich", "--checkpoint", str(file)]
    for more in ([], ["--json"]):
        with no_file_larger_than(5000), pytest.raises(Unavailable, match=r"c\.npz: File too large"):
            train.main([*words, *more])
        told = capsys.readouterr().out
        assert "episodes" in told
    assert json.loads(told)["checkpoint"] is None
    assert file.read_bytes() == b"older"
    assert [path.name for path in tmp_path.iterdir()] == ["c.npz"]


def test_outcomes_without_room_are_written_as_soon_as_there_is_some(tmp_path: Path, capsys):
    cells = [Cell(System("qtable"), 10, seed) for seed in range(4)]
    outcomes = [Outcome(seed, 1.0, 1.0, 1.0, 1.0, "", 0, [0.5] * 100, [1] * 24, 0.0) for seed in range(4)]
    results = Results(tmp_path, cells)
    results.add(0, outcomes[0])
    lines = tmp_path / "results.jsonl"
    size = lines.stat().st_size
    with no_file_larger_than(size + 100):
        results.add(1, outcomes[1])
        results.add(2, outcomes[2])
        with pytest.raises(Unavailable, match=r"results\.jsonl: File too large"):
            results.settle()
    assert lines.stat().st_size == size
    assert capsys.readouterr().err.count("File too large; the outcomes from now on are lost if") == 1
    assert results.missing == [3]
    results.add(3, outcomes[3])
    assert Results(tmp_path, cells).done == dict(enumerate(outcomes))
