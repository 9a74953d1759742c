"""A folder of results that a killed experiment continues."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct
from phototaxis.disk import append_whole, make_folder, try_folder, unwritten, write_whole
from phototaxis.errors import Unavailable, UserError, warn
from phototaxis_sim import arenas

from phototaxis_lab.cell import Cell, Outcome, System


class Row(Struct):
    """A cell and what became of it: one line of `results.jsonl`."""

    cell: Cell
    outcome: Outcome


class Results:
    """`grid.json`, the cells and all that decides their outcomes, and `results.jsonl`, one line for each that is done.

    Parameters
    ----------
    folder : made if it does not exist.
    cells : of the experiment.

    Raises
    ------
    UserError
        when the folder holds the results of other cells, or cannot be written.

    Outcomes that find no room on the disk are kept in memory and are written as soon as there is some.
    """

    def __init__(self, folder: Path, cells: Sequence[Cell]):
        self._path, self.cells = folder / "results.jsonl", list(cells)
        grid, encoded = folder / "grid.json", _grid(self.cells)
        self._waiting: list[bytes] = []
        try_folder(folder, "--out")
        make_folder(folder)
        try:
            if not grid.exists():
                write_whole(grid, encoded)
            elif grid.read_bytes() != encoded:
                raise UserError(f"{folder}: holds the results of another grid; give another folder, or remove this one")
            self.done: dict[int, Outcome] = self._read()
        except OSError as error:
            raise UserError(f"{folder}: {error.strerror}") from None

    def _read(self) -> dict[int, Outcome]:
        """What is done, by the index of the cell; a line that a kill left unfinished is dropped."""
        if not self._path.exists():
            return {}
        *whole, rest = self._path.read_bytes().split(b"\n")
        if rest:
            with self._path.open("r+b") as file:
                file.truncate(self._path.stat().st_size - len(rest))
        known = {_key(cell): index for index, cell in enumerate(self.cells)}
        rows = [self._row(number, line) for number, line in enumerate(whole, start=1)]
        return {known[_key(row.cell)]: row.outcome for row in rows}

    def _row(self, number: int, line: bytes) -> Row:
        try:
            return msgspec.json.decode(line, type=Row)
        except msgspec.MsgspecError as error:
            raise UserError(f"{self._path}, line {number}: {error}; mend it or remove it") from None

    @property
    def missing(self) -> list[int]:
        """Indices of the cells that are not done."""
        return [index for index in range(len(self.cells)) if index not in self.done]

    def add(self, index: int, outcome: Outcome) -> None:
        """Keep an outcome, at once if the disk has room."""
        self.done[index] = outcome
        self._waiting.append(msgspec.json.encode(Row(self.cells[index], outcome)) + b"\n")
        first = len(self._waiting) == 1
        try:
            self.settle()
        except Unavailable as fault:
            if first:
                warn(f"{fault}; the outcomes from now on are lost if you end this before there is room again")

    def settle(self) -> None:
        """Write the outcomes that wait for room.

        Raises
        ------
        Unavailable
            when there is still none.
        """
        while self._waiting:
            try:
                append_whole(self._path, self._waiting[0])
            except OSError as error:
                raise unwritten(self._path, error) from None
            self._waiting.pop(0)


def _grid(cells: Sequence[Cell]) -> bytes:
    """The cells, each system spelt out: its presets and its arena may have changed since a folder was begun."""
    systems = {
        str(system): {"as": System.of(system.setup(), system.arena), "arena": arenas.load(system.arena)}
        for system in dict.fromkeys(cell.system for cell in cells)
    }
    grid = {"systems": systems, "cells": [[str(cell.system), cell.epochs, cell.seed] for cell in cells]}
    return msgspec.json.format(msgspec.json.encode(grid), indent=1)


def _key(cell: Cell) -> Any:
    return msgspec.json.encode(cell)
