"""Shows the progress of a long computation on stderr: a bar on a terminal, elsewhere a line from time to time."""

import sys
import time
from shutil import get_terminal_size

from tqdm import tqdm

QUIET_S = 1.0
"""Seconds before the bar appears, so that a short computation shows nothing."""
LINE_EVERY_S = 15.0
"""Seconds between two lines."""


class Progress:
    """Counts how many of `total` units are done; a context manager.

    Parameters
    ----------
    total : number of units to do.
    unit : name of the unit, in the plural.
    """

    def __init__(self, total: int, unit: str):
        self._total, self._unit, self._done = total, unit, 0
        self._began = time.monotonic()
        self._speak_at = self._began + LINE_EVERY_S
        self._bar = None
        if total > 0 and sys.stderr.isatty():
            width, height = get_terminal_size()  # 80 × 24 if the terminal reports 0 × 0, with which tqdm shows nothing
            self._bar = tqdm(total=total, unit=f" {unit}", unit_scale=True, delay=QUIET_S, ncols=width, nrows=height)

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the bar; it stays visible as it is."""
        if self._bar is not None:
            self._bar.close()

    def add(self, count: int = 1) -> None:
        """Note that `count` more units are done."""
        self._done += count
        if self._bar is not None:
            self._bar.update(count)
        elif (now := time.monotonic()) >= self._speak_at:
            self._speak_at = now + LINE_EVERY_S
            print(self.line(now - self._began), file=sys.stderr, flush=True)

    def line(self, seconds: float) -> str:
        """Describe the progress after so many seconds, with an estimate of the time that is left."""
        left = seconds * (self._total - self._done) / max(self._done, 1)
        return f"{self._done:,} of {self._total:,} {self._unit}, about {tqdm.format_interval(left)} left"
