"""Each test has a world of its own: its name on the bus, its folder of sockets, its free ports."""

import os
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support import Process, command


@pytest.fixture(autouse=True)
def sockets(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A private, short folder for Unix sockets."""
    folder = tempfile.mkdtemp(prefix="pt-")
    monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
    yield
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def world() -> str:
    """A name that no other test has."""
    return f"t-{secrets.token_hex(3)}"


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Starts `phototaxis WORDS`; everything started ends with the test."""
    started: list[Process] = []

    def begin(*words: object, argv: list[str] | None = None) -> Process:
        process = Process(tmp_path, f"{len(started)}-{words[0]}", *(argv or command(*words)))
        started.append(process)
        return process

    yield begin
    for process in started:
        if process.popen.poll() is None:
            process.popen.terminate()
    for process in started:
        try:
            process.end(20)
        finally:
            process.kill()


@pytest.fixture
def up(start: Callable[..., Process], world: str, tmp_path: Path) -> Callable[..., Process]:
    """Starts `phototaxis up` in the test's world, on free ports."""

    def begin(*words: object) -> Process:
        return start(
            "up", "--name", world, "--out", tmp_path / "runs", "--grpc-port", 0, "--web-port", -1, "--json", *words
        )

    return begin


@pytest.fixture
def namespace() -> Iterator[tuple[list[str], str]]:
    """Another network namespace; gives the words that run a command there, and our address as it sees it."""
    ip = shutil.which("ip")
    give_up = pytest.fail if os.environ.get("PHOTOTAXIS_NEEDS_NAMESPACES") else pytest.skip
    if os.geteuid() != 0 or ip is None:
        give_up("needs root and `ip` to make a network namespace")
    name, net = f"pt{secrets.token_hex(3)}", f"10.213.{secrets.randbelow(256)}"
    steps = (
        f"{ip} netns add {name}",
        f"{ip} link add {name}a type veth peer name {name}b netns {name}",
        f"{ip} addr add {net}.1/30 dev {name}a",
        f"{ip} link set {name}a up",
        f"{ip} netns exec {name} ip addr add {net}.2/30 dev {name}b",
        f"{ip} netns exec {name} ip link set {name}b up",
    )
    try:
        for step in steps:
            done = subprocess.run(step.split(), capture_output=True, text=True, check=False)
            if done.returncode:
                give_up(f"this machine allows no network namespace: {step}: {done.stderr.strip()}")
        yield [ip, "netns", "exec", name], f"{net}.1"
    finally:
        subprocess.run([ip, "netns", "del", name], capture_output=True, check=False)
        subprocess.run([ip, "link", "del", f"{name}a"], capture_output=True, check=False)
