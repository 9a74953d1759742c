"""Real processes on a real bus: started, waited for by what they say there, and ended by pid."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.machine import Event
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.messages import Status

DEADLINE = 60.0


class Process:
    """One process with its output in files; shown when it dies before its time."""

    def __init__(self, folder: Path, name: str, *command: str):
        self.name = name
        self._out, self._err = folder / f"{name}.out", folder / f"{name}.err"
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self.popen = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err)

    @property
    def stdout(self) -> str:
        return self._out.read_text()

    @property
    def stderr(self) -> str:
        return self._err.read_text()

    def alive(self) -> None:
        """Fail with the process's stderr when it has died."""
        assert self.popen.poll() is None, f"{self.name} ended with {self.popen.returncode}:\n{self.stderr}"

    def end(self, deadline: float = DEADLINE) -> int:
        """Wait for the end of the process; its exit code."""
        try:
            return self.popen.wait(deadline)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.name} does not end:\n{self.stderr}") from None

    def stop(self) -> int:
        """Ask it to end (SIGTERM) and wait."""
        if self.popen.poll() is None:
            self.popen.terminate()
        return self.end()

    def kill(self) -> None:
        if self.popen.poll() is None:
            self.popen.kill()
            self.popen.wait()


def command(*words: object) -> list[str]:
    """`phototaxis WORDS` with this interpreter."""
    return [sys.executable, "-m", "phototaxis_launcher", *map(str, words)]


def phototaxis(*words: object, deadline: float = DEADLINE) -> subprocess.CompletedProcess[str]:
    """Run a `phototaxis` command to its end."""
    return subprocess.run(command(*words), capture_output=True, text=True, timeout=deadline, check=False)


def result(process: Process, code: int = 0) -> dict[str, Any]:
    """The JSON object that a command printed last, before it ended with `code`."""
    assert process.end() == code, process.stderr
    return json.loads(process.stdout.splitlines()[-1])


@contextmanager
def observer(name: str) -> Iterator[Bus]:
    """A place on the bus of a world, as an observer."""
    options = BusOptions(name=name)
    with open_session("observer", options) as session, Bus(session, name, "observer", "test") as bus:
        yield bus


def wait(bus: Bus, wanted: Callable[[Event], bool], *processes: Process) -> Event:
    """The first event that is wanted; fails when a process dies or the deadline passes."""
    deadline = time.monotonic() + DEADLINE
    while time.monotonic() < deadline:
        event = bus.receive(timeout=0.05)
        for process in processes:
            process.alive()
        if event is not None and wanted(event):
            return event
    raise AssertionError("nothing of the kind came:\n" + "\n".join(f"{p.name}: {p.stderr}" for p in processes))


def wait_status(bus: Bus, wanted: Callable[[Status], bool], *processes: Process) -> Status:
    """The first status that is wanted."""
    return wait(bus, lambda event: event.topic == "status" and wanted(event.message), *processes).message


def wait_alive(bus: Bus, role: str, *processes: Process) -> None:
    """Wait until the simulation knows a component of that role."""
    wait_status(bus, lambda status: any(who.startswith(f"{role}/") for who in status.alive), *processes)


def children(pid: int) -> dict[str, int]:
    """The component processes of a launcher: role → pid."""
    found = {}
    for child in psutil.Process(pid).children() if psutil.pid_exists(pid) else []:
        module = next((word for word in child.cmdline() if word.startswith("phototaxis_")), None)
        if module:
            found[module.removeprefix("phototaxis_")] = child.pid
    return found
