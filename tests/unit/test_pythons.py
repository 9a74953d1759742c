"""The Pythons that are promised: said alike everywhere, and everything is pinned for each of them."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging import tags
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROMISED = [
    found[1]
    for line in PROJECT["project"]["classifiers"]
    if (found := re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", line))
]
PINS = {
    canonicalize_name(name): version
    for name, _, version in (line.partition("==") for line in (ROOT / "constraints.txt").read_text().splitlines()[1:])
}


def needed(python: str) -> list[Requirement]:
    """All that our extras require there, our own extras left out."""
    project = PROJECT["project"]
    lines = [*project["dependencies"], *(line for extra in project["optional-dependencies"].values() for line in extra)]
    found = [Requirement(line) for line in lines if not line.startswith("phototaxis[")]
    return [one for one in found if one.marker is None or one.marker.evaluate({"python_version": python})]


def test_the_promise_is_the_same_everywhere():
    allowed = SpecifierSet(PROJECT["project"]["requires-python"])
    assert [f"3.{minor}" for minor in range(40) if f"3.{minor}" in allowed] == PROMISED
    first, last = PROMISED[0], PROMISED[-1]
    assert PROJECT["tool"]["pyright"]["pythonVersion"] == first
    assert PROJECT["tool"]["ruff"]["target-version"] == f"py{first.replace('.', '')}"
    for page in ("constraints.txt", "scripts/setup", "README.md"):
        assert f"{first} to {last}" in (ROOT / page).read_text(), page


@pytest.mark.parametrize("python", PROMISED)
def test_everything_is_pinned_for_each_python(python):
    for one in needed(python):
        assert one.specifier.contains(PINS[canonicalize_name(one.name)]), one
    windows = [one.name for one in needed(python) if one.name.startswith("pygame")]
    assert windows == ["pygame" if python < "3.14" else "pygame-ce"]


@pytest.mark.skipif(not os.environ.get("PHOTOTAXIS_ASK_INDEX"), reason="asks the index: set PHOTOTAXIS_ASK_INDEX=1")
@pytest.mark.parametrize("python", PROMISED)
def test_each_python_finds_wheels_of_all_pins(python, tmp_path):
    other = "pygame-ce" if python < "3.14" else "pygame"
    pins = tmp_path / "pins.txt"
    pins.write_text("\n".join(f"{name}=={version}" for name, version in PINS.items() if name != other))
    here = [f"--platform={platform}" for platform in tags.platform_tags()]
    pip = [sys.executable, "-m", "pip", "install", "--dry-run", "--quiet", "--no-deps", "--ignore-installed"]
    what = ["--only-binary=:all:", f"--target={tmp_path}", f"--python-version={python}", *here, f"--requirement={pins}"]
    done = subprocess.run([*pip, *what], capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
