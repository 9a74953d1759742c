"""The docker command, and one composed system as tests see it."""

import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.ports import free_ports
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.messages import Status

DEADLINE = 60.0
DOCKER = shutil.which("docker") or "docker"


def docker(*words: str, check: bool = True, **environment: str) -> str:
    """What `docker WORDS` prints; its stderr is in the error where it fails."""
    done = subprocess.run(
        [DOCKER, *words], capture_output=True, text=True, check=False, env={**os.environ, **environment}, timeout=900
    )
    if check and done.returncode:
        raise subprocess.CalledProcessError(done.returncode, f"docker {' '.join(words)}\n{done.stderr[-4000:]}")
    return done.stdout


class System:
    """One project of docker compose, on free ports of its own."""

    def __init__(self, name: str, folder: Path, environment: dict[str, str]):
        ports = self.bus_port, self.grpc_port, self.web_port = free_ports(3)
        published = zip(("BUS", "GRPC", "WEB"), ports, strict=True)
        self._environment = environment | {f"PHOTOTAXIS_{what}_PORT": str(port) for what, port in published}
        self.name, self.folder = name, folder
        self._files = ["-f", str(folder / "compose.yaml"), "-f", str(folder / "compose.own-router.yaml")]
        self.figures: dict[str, float] = {}

    def compose(self, *words: str, check: bool = True, **environment: str) -> str:
        """What `docker compose WORDS` prints."""
        return docker("compose", "-p", self.name, *self._files, *words, check=check, **self._environment | environment)

    def beside(self, name: str) -> "System":
        """A project of the same images, on ports that are free now."""
        return System(name, self.folder, self._environment)

    def inspect(self, service: str) -> dict[str, Any]:
        """What the engine knows of a service's container."""
        container = self.compose("ps", "-a", "-q", service).split()
        assert len(container) == 1, f"{service}: {container}"
        return json.loads(docker("inspect", container[0]))[0]

    @contextmanager
    def bus(self) -> Iterator[Bus]:
        """A place on the system's bus, from outside, as an observer."""
        options = BusOptions(connect=[f"tcp/127.0.0.1:{self.bus_port}"])
        with open_session("observer", options) as session, Bus(session, options.name, "observer", "test") as bus:
            yield bus

    def until(self, bus: Bus, wanted: Callable[[Status], bool]) -> Status:
        """The first status that is wanted; fails with the system's logs when none comes in time."""
        deadline, last = time.monotonic() + DEADLINE, None
        while time.monotonic() < deadline:
            event = bus.receive(timeout=0.2)
            if event is not None and event.topic == "status":
                last = event.message
                if wanted(last):
                    return last
        raise AssertionError(f"not within {DEADLINE:g} s; last {last}\n{self.compose('logs', '--tail', '20')}")

    def healthy(self, bus: Bus, service: str) -> dict[str, Any]:
        """Wait until a service's container is healthy; what the engine knows of it then."""
        deadline = time.monotonic() + DEADLINE
        while (found := self.inspect(service))["State"].get("Health", {}).get("Status") != "healthy":
            if time.monotonic() > deadline:
                raise AssertionError(f"{service} is not healthy: {found['State']}\n{self.compose('logs', service)}")
            bus.receive(timeout=0.2)
        return found
