"""How far a long computation is, on stderr: a bar with an estimate in a terminal, elsewhere a line now and then."""

import sys
import time
from shutil import get_terminal_size

from tqdm import tqdm

QUIET_S = 1.0
"""A computation that is shorter than this shows nothing."""
LINE_EVERY_S = 15.0


class Progress:
    """Counts what is done of `total`; a context.

    Parameters
    ----------
    total : how many there are to do.
    unit : what is counted, in the plural.
    """

    def __init__(self, total: int, unit: str):
        self._total, self._unit, self._done = total, unit, 0
        self._began = time.monotonic()
        self._speak_at = self._began + LINE_EVERY_S
        self._bar = None
        if total > 0 and sys.stderr.isatty():
            width, height = get_terminal_size()  # 80 × 24 for terminals that say 0 × 0, where tqdm shows nothing
            self._bar = tqdm(total=total, unit=f" {unit}", unit_scale=True, delay=QUIET_S, ncols=width, nrows=height)

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.close()

    def add(self, count: int = 1) -> None:
        """So many more are done."""
        self._done += count
        if self._bar is not None:
            self._bar.update(count)
        elif (now := time.monotonic()) >= self._speak_at:
            self._speak_at = now + LINE_EVERY_S
            print(self.line(now - self._began), file=sys.stderr, flush=True)

    def line(self, seconds: float) -> str:
        """How far it is after so many seconds, in words."""
        left = seconds * (self._total - self._done) / max(self._done, 1)
        return f"{self._done:,} of {self._total:,} {self._unit}, about {tqdm.format_interval(left)} left"
