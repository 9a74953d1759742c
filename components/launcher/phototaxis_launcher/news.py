"""Prints each change in the statuses of a run once: warnings, who is alive, a new run, a part that is too slow."""

from phototaxis.runtime.errors import warn
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.wire.messages import Status

from phototaxis_launcher.folder import RunFolder
from phototaxis_launcher.progress import Progress

SILENT_S = 5.0
"""Seconds that the driver may leave a tick unanswered before the launcher names it."""


class News:
    """Compares each status with the one before, and prints the differences."""

    def __init__(self, progress: Progress, folder: RunFolder, fmus: FmuOptions):
        self._progress, self._folder, self._run = progress, folder.path, folder.run
        named = [fmu for fmu in (fmus.light_fmu, fmus.sonar_fmu) if fmu]
        self._sensors = f" (the sensors use {' and '.join(named)})" if named else ""
        self._alive: list[str] = []
        self._complained = False

    def follow(self, status: Status) -> None:
        """Show a status, and print what is new in it."""
        self._progress.show(status)
        for line in status.warnings:
            warn(line)
        if status.run != self._run:
            self._run = status.run
            self._progress.say(f"a new run begins on request: {status.run}")
        alive = [who.split("/")[1] for who in status.alive if not who.startswith("observer/")]
        if alive != self._alive:
            self._alive = alive
            self._progress.say(f"alive: {', '.join(alive)}")
        complaint = self._complaint(status)
        if complaint and not self._complained:
            self._progress.say(complaint + self._sensors)
        self._complained = bool(complaint)

    def _complaint(self, status: Status) -> str:
        """Say which part is too slow or does not answer; "" when none is."""
        if status.too_slow:
            return f"at {status.speed:g} × real time {status.too_slow}; late commands stop the motors: lower the speed"
        if status.phase == "waiting" and status.driver and status.waited > SILENT_S:
            return f"{status.driver} is on the bus, but does not answer tick {status.tick}; see {self._folder}"
        return ""
