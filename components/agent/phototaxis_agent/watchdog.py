"""Warns when a learner does not return from a call, with the file and line where it is."""

import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

from phototaxis.runtime.errors import warn

from phototaxis_agent import checked

MAX_CALL_S = 10.0
"""Seconds that a learner may take for one call before it is named."""


@contextmanager
def watchdog(within: float = MAX_CALL_S) -> Generator[None]:
    """Warn on stderr, once, which method of a learner this thread has been in for `within` seconds."""
    over = threading.Event()
    thread = threading.Thread(target=_watch, args=(threading.get_ident(), over, within), daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()


def _watch(ident: int, over: threading.Event, within: float) -> None:
    """Look a few times within the patience; the same frame at every look has not returned in between."""
    seen, since, told = None, 0.0, False
    while not over.wait(within / 10):
        now = sys._current_frames().get(ident)
        call = _learner_call(now)
        if call is None or call is not seen:
            seen, since, told = call, time.monotonic(), False
        elif not told and time.monotonic() - since >= within:
            told = True
            warn(_line(call, now or call, within))


def _learner_call(frame: FrameType | None) -> FrameType | None:
    """The outermost call of a learner that the frame is in, if any."""
    found = None
    while frame is not None:
        found = frame if frame.f_code.co_filename == checked.__file__ else found
        frame = frame.f_back
    return found


def _line(call: FrameType, now: FrameType, within: float) -> str:
    learner = call.f_locals.get("self")
    name = learner.name if isinstance(learner, checked.CheckedLearner) else "?"
    place = f"{now.f_code.co_filename}, line {now.f_lineno}"
    return f"learner {name}: {call.f_code.co_name}() has not returned for {within:g} s ({place})"
