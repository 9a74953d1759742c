"""Restores a simulation that was killed from the frames of its journal."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from phototaxis.runtime.disk import write_failure
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.journal import GIVEN_UP, Journal

from phototaxis_sim.simulation import Simulation, Snapshot


class Entry(msgspec.Struct, array_like=True):
    """The command that is applied at one tick; with one robot also the journal's entry for that tick."""

    left: Any
    right: Any
    author: str
    end: Any


class Continued(NamedTuple):
    """A run at an episode's first tick, and the commands that were applied since."""

    simulation: Simulation
    snapshot: Snapshot
    entries: list[Entry]


def open_journal(journal: Journal, fresh: Simulation) -> Continued | None:
    """Read this run from the journal and keep the journal open for it; begin a new journal if it has no such run.

    Raises
    ------
    UserError, Unavailable
        as in `continued`, and when the journal cannot be written.
    """
    frames = journal.read()
    found = continued(frames, fresh, journal.path)
    try:
        if found is None:
            journal.begin(msgspec.msgpack.encode(fresh.snapshot([], "")))
        else:
            journal.resume(frames)
    except OSError as error:
        raise write_failure(journal.path, error) from None
    return found


def continued(frames: Sequence[bytes], fresh: Simulation, path: Path) -> Continued | None:
    """The run that a journal holds; None when it holds none, or another run than `fresh`.

    Runs that were begun by request in place of `fresh` have its name with four more hexadecimal digits.

    Raises
    ------
    UserError
        when the frames are not a simulation's, or the arena is another one now; `path` names the journal.
    Unavailable
        when the journal could not be written to its end.
    """
    if not frames:
        return None
    try:
        snapshot = msgspec.msgpack.decode(frames[0], type=Snapshot)
        entries = [msgspec.msgpack.decode(frame, type=Entry) for frame in frames[1:] if frame != GIVEN_UP]
    except msgspec.MsgspecError:
        raise UserError(f"{path}: not the journal of a simulation; name another file") from None
    world, root = fresh.world, re.escape(fresh.world.run[:50])
    if snapshot.run != world.run and not re.fullmatch(rf"{root}\.[0-9a-f]{{4}}", snapshot.run):
        return None
    if snapshot.arena != fresh.digest:
        raise UserError(f"the run {snapshot.run} began in another arena than '{world.arena.name}' is now")
    if GIVEN_UP in frames:
        raise Unavailable(f"{path}: could not be written to its end; the run cannot be continued, begin a new one")
    simulation = fresh.anew(snapshot.seed, snapshot.run)
    simulation.restore(snapshot)
    return Continued(simulation, snapshot, entries)
