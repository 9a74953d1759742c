"""Hooks through which a run is presented to people who watch it."""

from typing import Any

from phototaxis.runtime.bus import Bus
from phototaxis.wire.messages import Status

from phototaxis_launcher.progress import Progress


class Show:
    """Called by a run as it proceeds; this base class shows nothing."""

    def wait(self) -> float:
        """Return the most seconds until the run calls `beat` again."""
        return 0.1

    def beat(self, bus: Bus) -> None:
        """Called after each event and after each wait."""

    def follow(self, status: Status, bus: Bus, progress: Progress) -> None:
        """Called with each new status."""

    def finished(self, result: dict[str, Any]) -> bool:
        """Called with the result of a finished run; return whether all processes stay up until they are stopped."""
        return False
