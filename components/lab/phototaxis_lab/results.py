"""Keeps the results of an experiment in a folder, so that a killed experiment can continue."""

import fcntl
import json
import os
from codecs import BOM_UTF8
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct
from phototaxis.runtime.disk import append_atomic, check_folder_writable, make_folder, write_atomic, write_failure
from phototaxis.runtime.errors import Unavailable, UserError, warn
from phototaxis.runtime.phrases import plain
from phototaxis_sim import arenas

from phototaxis_lab.cell import Cell, Outcome, System


class Row(Struct):
    """A cell and its outcome: one line of `results.jsonl`."""

    cell: Cell
    outcome: Outcome


class Results:
    """The outcomes of cells in a folder.

    `grid.json` holds the systems, with everything that their outcomes depend on; `results.jsonl` holds a line for each
    cell that is done. A folder can be extended with more seeds, epochs or systems; its other outcomes stay there.
    Outcomes for which the disk has no room stay in memory, and are written as soon as it has.

    Parameters
    ----------
    folder : made if it does not exist.
    cells : all cells of the experiment.

    Raises
    ------
    UserError
        when the folder has a system of the same name with other options or another arena, or cannot be written.
    """

    def __init__(self, folder: Path, cells: Sequence[Cell]):
        self._path, self.cells = folder / "results.jsonl", list(cells)
        self._waiting: list[bytes] = []
        check_folder_writable(folder, "--out", keep=True)
        make_folder(folder)
        try:
            self._extend(folder / "grid.json")
            self.done: dict[int, Outcome] = self._read()
        except OSError as error:
            raise UserError(f"{folder}: {error.strerror}") from None

    def _extend(self, file: Path) -> None:
        """Add new systems to the grid; UserError when a known one has changed."""
        ours = _systems(self.cells)
        if self._path.exists() and not file.exists():
            raise UserError(f"{file}: missing, so it is unknown what the results mean; give another folder")
        try:
            known = json.loads(file.read_text("utf-8-sig"))["systems"] if file.exists() else {}
            changed = next((name for name in ours if known.get(name, ours[name]) != ours[name]), None)
        except (ValueError, LookupError, TypeError, AttributeError):
            raise UserError(f"{file}: damaged; remove it, or give another folder") from None
        if changed is not None:
            raise UserError(
                f"{file.parent}: holds results of '{changed}' in another arena or with other options; "
                "give another folder, or remove this one"
            )
        if ours.keys() - known.keys():
            write_atomic(file, json.dumps({"systems": known | ours}, indent=1).encode())

    def _read(self) -> dict[int, Outcome]:
        """Read the outcomes, by index of the cell; drop a last line that a kill left unfinished."""
        if not self._path.exists():
            return {}
        *whole, rest = self._path.read_bytes().removeprefix(BOM_UTF8).split(b"\n")
        if rest:
            with self._path.open("r+b") as file:
                file.truncate(self._path.stat().st_size - len(rest))
        known = {_key(cell): index for index, cell in enumerate(self.cells)}
        rows = [self._row(number, line) for number, line in enumerate(whole, start=1)]
        return {known[key]: row.outcome for row in rows if (key := _key(row.cell)) in known}

    def _row(self, number: int, line: bytes) -> Row:
        try:
            return msgspec.json.decode(line, type=Row)
        except msgspec.MsgspecError as error:
            raise UserError(f"{self._path}, line {number}: {plain(str(error))}; repair or remove the line") from None

    @property
    def missing(self) -> list[int]:
        """Indices of the cells that are not done."""
        return [index for index in range(len(self.cells)) if index not in self.done]

    def add(self, index: int, outcome: Outcome) -> None:
        """Add an outcome, and write it at once if the disk has room."""
        self.done[index] = outcome
        self._waiting.append(msgspec.json.encode(Row(self.cells[index], outcome)) + b"\n")
        first = len(self._waiting) == 1
        try:
            self.settle()
        except Unavailable as fault:
            if first:
                warn(f"{fault}; the outcomes from now on are lost if you end this before the disk has room again")

    def settle(self) -> None:
        """Write the outcomes that wait for room on the disk.

        Raises
        ------
        Unavailable
            when there is still no room.
        """
        while self._waiting:
            try:
                append_atomic(self._path, self._waiting[0])
            except OSError as error:
                raise write_failure(self._path, error) from None
            self._waiting.pop(0)


def _systems(cells: Sequence[Cell]) -> dict[str, Any]:
    """Return each system with all option values and its arena, because these may change while the name stays."""
    systems = {
        str(system): {"as": System.of(system.setup(), system.arena), "arena": arenas.load(system.arena)}
        for system in dict.fromkeys(cell.system for cell in cells)
    }
    return json.loads(msgspec.json.encode(systems))


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Lock a folder against other experiments; make it if it is missing.

    Raises
    ------
    Unavailable
        when another process has locked it.
    UserError
        when the folder cannot be used.
    """
    check_folder_writable(folder, "--out", keep=True)
    with ExitStack() as stack:
        try:
            lock = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, lock)
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            line = f"{folder}: another experiment computes there; wait until it ends, or give another folder with --out"
            raise Unavailable(line) from None
        except OSError as error:
            raise UserError(f"{folder}: {error.strerror}") from None
        yield


def _key(cell: Cell) -> Any:
    return msgspec.json.encode(cell)
