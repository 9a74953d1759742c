"""`phototaxis up`: starts the processes of a run, supervises them, and ends them together."""

import json
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.errors import ComponentFailed
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.ports import find_ports, viewer_url
from phototaxis.runtime.session import open_session
from phototaxis.wire.messages import Control, Status

from phototaxis_launcher.folder import RunFolder
from phototaxis_launcher.news import News
from phototaxis_launcher.options import UpOptions, parse
from phototaxis_launcher.paths import program
from phototaxis_launcher.processes import Processes
from phototaxis_launcher.progress import Progress
from phototaxis_launcher.requests import SwapRequests
from phototaxis_launcher.result import exit_code, result, summary
from phototaxis_launcher.show import Show
from phototaxis_launcher.watch import Watch

ANSWERED_WITHIN_S = 5.0
"""When a run is stopped: seconds for the simulation to pause, and for the driver to answer the last tick."""
STARTING_S = 60.0
"""Seconds within which all components must be on the bus."""


def main(argv: Sequence[str]) -> int:
    options, fmus, words = parse(argv)
    run = Run(options, fmus, words)
    status = run.go()
    found = run.result(status)
    if options.json:
        print(json.dumps(found), flush=True)
    else:
        print(*summary(found), sep="\n", file=sys.stderr)
    return run.end(status)


class Run:
    """One run of the system: its processes, and the loop that follows its statuses from the first to the last."""

    def __init__(self, options: UpOptions, fmus: FmuOptions, words: list[str], show: Show | None = None):
        self._options, self._show = options, show or Show()
        wanted = {"--grpc-port": options.grpc_port, "--web-port": options.web_port}
        ports = [] if options.no_recorder else find_ports("127.0.0.1", wanted)
        self._url = viewer_url(ports[1], ports[0]) if ports and ports[1] > 0 else ""
        self._folder = RunFolder(Path(options.out))
        self._processes = Processes(options, fmus, words, self._folder, ports)
        self._progress = Progress(options.epochs)
        self._news = News(self._progress, self._folder, fmus)
        self._requests = SwapRequests(self._processes, self._progress)
        self._watch = Watch(self._processes, self._requests, self._progress, self._folder)
        self._interrupted = False

    def go(self) -> Status:
        """Start the processes, follow the run until it is finished or stopped, end them; return the last status.

        The agent starts when everyone else is on the bus, so that the recording has every tick. A run that is
        stopped is paused first, so that status, checkpoints and recording end with the same tick.
        """
        with (
            self._folder.kept_once_begun(),
            open_session("launcher", self._options) as session,
            Bus(session, self._options.name, "launcher", f"up-{self._folder.run}") as bus,
        ):
            self._stop_on_signals(bus)
            try:
                self._processes.start()
                return self._follow(bus)
            finally:
                try:
                    self._progress.close()
                finally:
                    self._processes.stop()

    def result(self, status: Status) -> dict[str, Any]:
        """Return the outcome of the run as plain data."""
        return result(status, self._options, self._folder, self._processes)

    def end(self, status: Status) -> int:
        """Return the exit code, after the result is printed; raises as `exit_code` does."""
        return exit_code(status, self._processes, self._interrupted)

    def _stop_on_signals(self, bus: Bus) -> None:
        def stop(number: int, _: object) -> None:
            self._interrupted = self._interrupted or number == signal.SIGINT
            bus.stop()

        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, stop)

    def _follow(self, bus: Bus) -> Status:
        """Handle events until the run is finished or stopped; return the last status."""
        status, deadline = Status(run=self._folder.run, phase="waiting"), time.monotonic() + STARTING_S
        while not self._complete(status) and not self._processes.children["sim"].left:
            event = bus.receive(timeout=self._show.wait())
            self._show.beat(bus)
            self._watch.look()
            if event is not None and event.topic == "stop":
                return _paused(bus, status)
            if event is not None and event.topic == "launch":
                self._requests.begin(event)
            if event is not None and event.topic == "status":
                status = event.message
                self._take(status, bus)
            if self._processes.children["agent"].process is None:
                self._start_agent(status, deadline)
        if self._processes.children["sim"].left:
            status = _last(bus, status)
        self._progress.close()
        if status.phase == "finished" and self._show.finished(self.result(status)):
            self._linger(bus)
        return status

    def _complete(self, status: Status) -> bool:
        """Whether the run is finished and all components are on the bus to end with it (one may just be restarting)."""
        return status.phase == "finished" and self._processes.complete(status)

    def _take(self, status: Status, bus: Bus) -> None:
        """Pass a status to everything that follows the run."""
        self._folder.begun = self._folder.begun or status.tick > 0
        self._news.follow(status)
        self._requests.confirm(status)
        self._watch.miss(status)
        self._show.follow(status, bus, self._progress)

    def _start_agent(self, status: Status, deadline: float) -> None:
        """Start the first agent as soon as the others are on the bus."""
        if missing := self._processes.missing(status):
            if time.monotonic() > deadline:
                who = ", ".join(missing)
                raise ComponentFailed(f"{who} did not come up within {STARTING_S:g} s; see {self._folder.path}")
            return
        self._processes.children["agent"].start()
        if self._url:
            self._progress.say(f"watch at {self._url}")

    def _linger(self, bus: Bus) -> None:
        """Keep all processes up, for those who watch, until a signal comes or the simulation is stopped."""
        where = self._url or f"{program()} view"
        print(f"Watch again: {where}\nDrag the time line to any moment of the run. Ctrl-C ends.", file=sys.stderr)
        while not self._processes.children["sim"].left:
            event = bus.receive(timeout=0.1)
            if event is not None and event.topic == "stop":
                return
            self._watch.look()


def _paused(bus: Bus, status: Status) -> Status:
    """Pause the run, wait until the driver has answered its last tick, and return the status."""
    reply, deadline = bus.control(Control(verb="pause"), ANSWERED_WITHIN_S), time.monotonic() + ANSWERED_WITHIN_S
    while reply is not None:
        status = reply.status  # requested, because a status in the inbox may be older than the pause
        if status.phase != "paused" or not status.waiting_for or time.monotonic() > deadline:
            break
        bus.receive(timeout=0.05)
        reply = bus.control(Control(verb="status"), ANSWERED_WITHIN_S)
    return status


def _last(bus: Bus, status: Status) -> Status:
    """Return the last status of a simulation that has ended on request."""
    while (event := bus.receive(timeout=0.2)) is not None:
        status = event.message if event.topic == "status" else status
    return status
