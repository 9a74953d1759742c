"""Reads what an earlier process has left on disk, and opens the journal for this one."""

from pathlib import Path

from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.disk import write_failure
from phototaxis.runtime.journal import Journal

from phototaxis_agent.keeping import Kept


def read(resume: Path | None, required: bool, journal: Journal | None) -> Kept:
    """The checkpoint `resume`, if it exists (`required`: it must), and the journal's frames.

    Without `resume` an older journal does not count. What a kill tore off its end is cut off.

    Raises
    ------
    UserError
        when a file is missing, damaged or of another kind.
    Unavailable
        when the journal cannot be opened.
    """
    if resume is None:
        return Kept()
    checkpoint = load(resume) if required or resume.exists() else None
    if journal is None:
        return Kept(str(resume), checkpoint)
    frames = journal.read()
    try:
        if frames:
            journal.resume(frames)
    except OSError as error:
        raise write_failure(journal.path, error) from None
    return Kept(str(resume), checkpoint, str(journal.path), frames)
