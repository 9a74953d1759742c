"""Supervises the processes of a run: restarts those that die, and goes on without those that are not needed."""

from phototaxis.runtime.errors import UserError, warn
from phototaxis.wire.messages import Status

from phototaxis_launcher.folder import RunFolder
from phototaxis_launcher.processes import Processes
from phototaxis_launcher.progress import Progress
from phototaxis_launcher.requests import SwapRequests


class Watch:
    """Supervises the child processes of a launcher."""

    def __init__(self, processes: Processes, requests: SwapRequests, progress: Progress, folder: RunFolder):
        self._processes, self._requests, self._progress = processes, requests, progress
        self._see = f"was restarted; see {folder.path}"
        self._drove: set[str] = set()

    def look(self) -> None:
        """Pass on warnings, and restart processes that have died.

        Raises
        ------
        UserError
            when a component explained why it ended, or keeps dying.
        """
        for child in self._processes.all():
            for line in child.warnings():
                warn(line)
            try:
                if child.watch():
                    self._progress.say(f"{child.name} ended and {self._see}")
            except UserError as error:
                if child.name == "recorder" and self._processes.agents[0].process is not None:
                    self._processes.go_on_without_recorder(error)
                    warn(f"{error}; the run goes on without it")
                elif not self._requests.fail(child, str(error)):
                    raise

    def miss(self, status: Status) -> None:
        """Restart an agent that ended without an error though nobody has taken over the seat from it."""
        self._drove |= {one.driver for one in status.drivers}
        last = status.drivers[-1].driver if status.drivers else ""
        for agent in self._processes.agents:
            drove = self._drove & {*agent.idents}
            if agent.left and status.phase != "finished" and not status.driver and (last in drove or not drove):
                agent.bring_back()
                self._progress.say(f"{agent.name} ended before its time and {self._see}")
