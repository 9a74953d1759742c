"""Shows the progress of a run on stderr: a bar on a terminal, plain lines elsewhere."""

import sys
import time

from phototaxis.wire.messages import Status

LINE_EVERY_S = 2.0
"""Seconds between two plain lines."""


class Progress:
    """Shows each new status of a run, and news lines between them."""

    def __init__(self, epochs: int):
        from tqdm import tqdm

        self._said = 0.0
        self._bar = tqdm(total=epochs or None, unit=" epochs", dynamic_ncols=True) if sys.stderr.isatty() else None

    def show(self, status: Status) -> None:
        """Update the display with a status."""
        facts = (
            f"{success(status)}, {status.rate:.0f} ticks/s"
            if status.phase != "waiting"
            else f"waiting for {status.waiting_for} ({status.waited:.0f} s)"
        )
        if self._bar is not None:
            self._bar.n = status.epoch
            self._bar.set_postfix_str(facts, refresh=False)
            self._bar.refresh()
        elif time.monotonic() - self._said >= LINE_EVERY_S or status.phase == "finished":
            self._said = time.monotonic()
            total = f"/{status.epochs}" if status.epochs else ""
            print(f"epoch {status.epoch}{total}  {facts}", file=sys.stderr, flush=True)

    def say(self, text: str) -> None:
        """Print one line of news."""
        if self._bar is not None:
            self._bar.write(text, file=sys.stderr)
        else:
            print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def success(status: Status) -> str:
    """Say in words how many of the newest episodes reached the light."""
    if not status.episodes:
        return "no episode has ended yet"
    if status.episodes == 1:
        return "the first episode " + ("reached the light" if status.reached else "did not reach the light")
    return f"{status.recent:.0%} of the last {min(status.episodes, 50)} episodes reached the light"
