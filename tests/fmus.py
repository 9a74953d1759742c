"""FMUs for tests: the shipped examples, and broken ones made from them."""

import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from phototaxis_sensors.fmu.build import Version, build
from phototaxis_sensors.fmu.examples import EXAMPLES, Example, Variable

FAULTY = Example(
    "faulty",
    "Does what it should not",
    (
        Variable("u", "input", 0.0, "", "in"),
        Variable("y", "output", None, "", "out", low=0.0, high=5.0),
        Variable("fault", "parameter", 0.0, "", "which"),
        Variable("at", "parameter", 3.0, "", "at which step"),
    ),
    Path(__file__).parent / "fmu",
)
FAULTS = {"error": 1, "discard": 2, "NaN": 3, "out of range": 4, "segfault": 5, "endless": 6, "forgets": 7, "exits": 8}
KNOWN = {**EXAMPLES, "faulty": FAULTY}


def require_compiler() -> None:
    """Skip where nothing can be compiled; where the surroundings promise a compiler, fail."""
    if shutil.which("g++") and shutil.which("make"):
        return
    assert not os.environ.get("PHOTOTAXIS_NEEDS_COMPILER"), "no C compiler"
    pytest.skip("building FMUs needs gcc, g++ and make")


Built = Callable[[str, Version], Path]


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Builds an example once for all tests."""
    folder = tmp_path_factory.mktemp("fmus")

    def make(name: str, version: Version) -> Path:
        file = folder / f"{name}{version}.fmu"
        if not file.exists():
            require_compiler()
            build(KNOWN[name], version, file)
        return file

    return make


def edited(source: Path, target: Path, edit: Callable[[str, bytes], tuple[str, bytes] | None]) -> Path:
    """A copy of an FMU whose members went through `edit`: another name and content, or None for none."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for member in old.namelist():
            if not member.endswith("/") and (kept := edit(member, old.read(member))):
                new.writestr(*kept)
    return target


def described(source: Path, target: Path, old: str, new: str) -> Path:
    """A copy with a replacement in its model description."""

    def edit(name: str, data: bytes) -> tuple[str, bytes]:
        if name == "modelDescription.xml":
            assert old.encode() in data
            data = data.replace(old.encode(), new.encode())
        return name, data

    return edited(source, target, edit)


def workers() -> list[int]:
    """Pids of FMU processes that this test, or what it started, has left."""
    left = []
    for process in psutil.process_iter(["cmdline", "environ"]):
        words = process.info["cmdline"] or []
        environ = process.info["environ"] or {}
        ours = environ.get("XDG_RUNTIME_DIR") == os.environ.get("XDG_RUNTIME_DIR")
        if "phototaxis_sensors.fmu.worker" in words and ours:
            left.append(process.pid)
    return left
