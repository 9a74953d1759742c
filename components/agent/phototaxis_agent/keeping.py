"""Decides when an agent writes a checkpoint, and keeps a journal of the readings since then."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import msgspec
import numpy as np
from phototaxis.runtime.checkpoint import CheckpointMetadata
from phototaxis.runtime.errors import Unavailable
from phototaxis.runtime.journal import GIVEN_UP
from phototaxis.runtime.machine import Append, Begin, Effect, Save, Unwritten, Warn
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.wire.messages import Readings

SAVE_EVERY_S = 10.0


class Kept(NamedTuple):
    """What was on disk when the process began."""

    source: str = ""
    """The checkpoint's file, for messages."""
    checkpoint: tuple[CheckpointMetadata, dict[str, np.ndarray]] | None = None
    journal: str = ""
    frames: list[bytes] = []  # noqa: RUF012 - never changed
    """The journal's header, a run, and entries, readings; empty where there is none to continue."""


class Keeping:
    """Decides what the agent writes to disk, and when. It writes nothing where `wanted` is False.

    The journal's entry of a tick comes before the command is published. An entry that the disk does not take is
    not written again: the checkpoint that follows holds what was learned from it, and begins the journal anew.
    """

    def __init__(self, wanted: bool, kept: Kept):
        self._wanted, self._kept, self._frames = wanted, kept, kept.frames
        self._saved: tuple[str, int] | None = ("", -1)
        """Run and tick of the newest checkpoint; None when the journal since then is not complete."""
        self._save_at = 0.0

    def enter(self, run: str, tick: tuple[str, int], now: float) -> Iterator[Readings] | None:
        """Begin to keep a run; the readings to be gone through again if the journal on disk is of this run, else None.

        Raises
        ------
        Unavailable
            by the iterator, when the journal ends before the process did.
        """
        self._save_at = now + SAVE_EVERY_S
        frames, self._frames = self._frames, []
        return self._again(frames, run, tick) if self._wanted and frames and frames[0] == run.encode() else None

    def begin(self, run: str, agent: SeatedAgent, now: float) -> list[Effect]:
        """Begin a new journal for a run, after a checkpoint of what the agent has learned in another run."""
        return [*self.save(agent, now), Begin(run.encode())] if self._wanted else []

    def entry(self, readings: Readings) -> list[Effect]:
        """Add one tick's readings to the journal."""
        return [Append(msgspec.msgpack.encode(readings))] if self._wanted else []

    def due(self, now: float) -> bool:
        """Whether a checkpoint is due by the clock."""
        return now >= self._save_at

    def save(self, agent: SeatedAgent, now: float, complete: bool = False, last: bool = False) -> list[Effect]:
        """A checkpoint of the present state, unless there is one; of a `complete` run it is tried whether it loads."""
        self._save_at = now + SAVE_EVERY_S
        if not self._wanted or agent.tick == self._saved:
            return []
        meta, arrays = agent.checkpoint()
        if complete or last:
            agent.prove(arrays)
        self._saved = agent.tick
        return [Save(meta, arrays, agent.tick[0].encode(), last)]

    def write_failure(self, what: Unwritten, agent: SeatedAgent | None, now: float) -> list[Effect]:
        """After a failed write: warn, and replace a journal that was given up by a checkpoint."""
        again = what.what == "journal" and agent is not None and agent.tick != self._saved
        self._saved = None
        told = Warn(f"{what.why}; if it dies now, what it learned since its last checkpoint is lost")
        return [told, *self.save(agent, now)] if again and agent is not None else [told]

    def _again(self, frames: list[bytes], run: str, tick: tuple[str, int]) -> Iterator[Readings]:
        for frame in frames[1:]:
            if frame == GIVEN_UP:
                raise Unavailable(
                    f"{self._kept.journal}: could not be written to its end; what was learned after tick {tick[1]} is "
                    f"lost, begin a new run with --resume {self._kept.source}"
                )
            readings = msgspec.msgpack.decode(frame, type=Readings)
            if tick[0] != run or readings.tick > tick[1]:
                yield readings


def restored(agent: SeatedAgent, kept: Kept, arena: Any) -> list[Effect]:
    """Continue from the checkpoint on disk; a warning when it learned elsewhere."""
    if kept.checkpoint is None:
        return []
    meta, arrays = kept.checkpoint
    agent.restore(meta, arrays, kept.source)
    other = meta.elsewhere(arena)
    return [Warn(f"{kept.source}: {other}")] if other else []
