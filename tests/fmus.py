"""FMUs for tests: the shipped examples, and broken ones made from them."""

import os
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import psutil
import pytest
from phototaxis_fmu.build import Version, build
from phototaxis_fmu.examples import EXAMPLES, Example, Variable

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
        if "phototaxis_fmu.worker" in words and ours:
            left.append(process.pid)
    return left


Replaced = dict[str, str]


def altered(target: Path, name: str, version: Version, code: Replaced, description: Replaced | None = None) -> Path:
    """An example with other texts in its C sources and its description, and a library of them."""
    require_compiler()
    build(KNOWN[name], version, target, sources_only=True)
    left = {**code, **(description or {})}

    def edit(member: str, data: bytes) -> tuple[str, bytes]:
        text = data.decode()
        for old, new in (description or {} if member == "modelDescription.xml" else code).items():
            if old in text:
                left.pop(old, None)
                text = text.replace(old, new)
        return member, text.encode()

    plain = target.with_suffix(".plain")
    shutil.copy(target, plain)
    edited(plain, target, edit)
    assert not left, f"not there: {left}"
    with tempfile.TemporaryDirectory() as folder:
        with zipfile.ZipFile(target) as archive:
            archive.extractall(folder)
        sources, library = Path(folder) / "sources", Path(folder) / f"{name}.so"
        headers = Path(fmpy.__file__).parent / "c-code"
        files = [sources / f"{name}.c", sources / f"fmi{version}.c"]
        command = ["gcc", "-shared", "-fPIC", "-w", "-I", headers, "-I", sources, *files, "-o", library, "-lm"]
        subprocess.run(command, check=True)
        with zipfile.ZipFile(target, "a") as archive:
            place = fmpy.platform if version == 2 else fmpy.platform_tuple
            archive.write(library, f"binaries/{place}/{name}{fmpy.sharedLibraryExtension}")
    return target
