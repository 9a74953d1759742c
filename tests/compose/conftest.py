"""The composed system on a real Docker engine: built from nothing, brought up once for all tests here."""

import os
import secrets
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from engine import System, docker

PROJECT = Path(__file__).resolve().parents[2]
NEEDED = "PHOTOTAXIS_NEEDS_DOCKER"
"""Set where a missing engine is a failure and no reason to skip."""


@pytest.fixture(scope="session")
def engine() -> None:
    """A Docker engine with compose v2 that answers."""
    for words in (["info"], ["compose", "version"]):
        try:
            docker(*words)
        except (FileNotFoundError, subprocess.CalledProcessError) as error:
            why = f"no Docker engine with compose v2 answers here ({error})"
            if os.environ.get(NEEDED):
                pytest.fail(why)
            pytest.skip(why)


@pytest.fixture(scope="session")
def system(engine: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    """The system of deploy/compose.yaml with our own router, at full speed, on free ports; all healthy."""
    sources = tmp_path_factory.mktemp("project")
    for name in ("components", "deploy", "pyproject.toml", "constraints.txt", "README.md", "LICENSE", ".dockerignore"):
        place = PROJECT / name
        if place.is_dir():
            shutil.copytree(place, sources / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(place, sources)
    for folder in os.environ.get("PIP_FIND_LINKS", "").split():
        for wheel in Path(folder).glob("*.whl"):
            shutil.copy(wheel, sources / "deploy/wheels")
    wheels = {wheel.name.split("-")[0] for wheel in (sources / "deploy/wheels").glob("*.whl")}
    name = f"phototaxis-test-{secrets.token_hex(3)}"
    environment = {
        "PHOTOTAXIS_TAG": name,
        "PHOTOTAXIS_HEALTH_INTERVAL": "2s",
        "PHOTOTAXIS_SPEED": "0",
        **({"TORCH_INDEX": ""} if "torch" in wheels else {}),
    }
    system = System(name, sources / "deploy", environment)
    try:
        began = time.monotonic()
        system.compose("build")
        built = time.monotonic()
        system = system.beside(name)  # building takes long enough for a port to be taken
        system.compose("up", "-d", "--wait")
        healthy = time.monotonic()
        with system.bus() as bus:
            system.until(bus, lambda status: status.tick > 0)
        system.figures = {
            "build": built - began,
            "up until all are healthy": healthy - built,
            "up until the first tick is seen": time.monotonic() - built,
        }
        yield system
    finally:
        system.compose("--profile", "*", "down", "--volumes", "--rmi", "all", check=False)
