"""What a run shows to those who watch it."""

from typing import Any

from phototaxis.runtime.bus import Bus
from phototaxis.wire.messages import Status

from phototaxis_launcher.progress import Progress


class Show:
    """What happens for those who watch a run: by default nothing."""

    def wait(self) -> float:
        """Seconds until `beat` is to be called, at most."""
        return 0.1

    def beat(self, bus: Bus) -> None:
        """Time has passed, or something has come."""

    def follow(self, status: Status, bus: Bus, progress: Progress) -> None:
        """A status has come."""

    def finished(self, result: dict[str, Any]) -> bool:
        """The run has come to this result; whether everything stays up until it is stopped."""
        return False
