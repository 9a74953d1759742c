"""What a component keeps on disk: a checkpoint and the journal of what happened since."""

from pathlib import Path

from phototaxis.runtime.checkpoint import save
from phototaxis.runtime.disk import write_failure
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.journal import Journal
from phototaxis.runtime.machine import Append, Begin, Save, Unwritten


class Store:
    """Carries out `Begin`, `Append` and `Save`; without a file they do nothing.

    A journal that cannot be written is given up, and marked so in the file, until the next `Begin` or `Save`.

    Attributes
    ----------
    fault : why the final checkpoint of the process could not be written; None if there was no such error.
    """

    def __init__(self, journal: Journal | None = None, checkpoint: Path | None = None):
        self._journal, self._checkpoint = journal, checkpoint
        self.fault: UserError | None = None

    def carry(self, effect: Begin | Append | Save) -> Unwritten | None:
        """Write to disk; return an event for the machine when that fails, else None."""
        if isinstance(effect, Save):
            return self._save(effect) or self._begin(effect.header)
        return self._begin(effect.header) if isinstance(effect, Begin) else self._append(effect.entry)

    def _save(self, effect: Save) -> Unwritten | None:
        if self._checkpoint is None:
            return None
        try:
            save(self._checkpoint, effect.meta, effect.arrays)
        except Unavailable as fault:
            self.fault = fault if effect.last else None
            return Unwritten("checkpoint", str(fault))
        return None

    def _begin(self, header: bytes) -> Unwritten | None:
        if self._journal is None:
            return None
        try:
            self._journal.begin(header)
        except OSError as error:
            return self._give_up(self._journal, error)
        return None

    def _append(self, entry: bytes) -> Unwritten | None:
        if self._journal is None or not self._journal.kept:
            return None
        try:
            self._journal.append(entry)
        except OSError as error:
            return self._give_up(self._journal, error)
        return None

    def _give_up(self, journal: Journal, error: OSError) -> Unwritten:
        journal.give_up()
        return Unwritten("journal", str(write_failure(journal.path, error)))
