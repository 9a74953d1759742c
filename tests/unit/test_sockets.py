"""The private folder of this machine's sockets: every fault of it is one true line."""

import fcntl
import os
import socket
import stat
import tempfile
from pathlib import Path

import pytest
import zenoh
from phototaxis.runtime import session, sockets
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.options import parse
from phototaxis.runtime.session import BusOptions, open_session

WHOLE = sockets.MAX_PATH_BYTES - sockets.MAX_SOCKET_NAME_BYTES


@pytest.fixture
def base(monkeypatch):
    """A short, private folder in XDG_RUNTIME_DIR."""
    with tempfile.TemporaryDirectory(prefix="pt-") as folder:
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        yield Path(folder)


def refused(name: str = "w") -> str:
    with pytest.raises(Unavailable) as why:
        sockets.socket_folder(name)
    assert "\n" not in str(why.value)
    return str(why.value)


def test_the_folder_is_made_and_private(base):
    folder = sockets.socket_folder("w")
    assert folder == base / "phototaxis" / "w"
    assert stat.S_IMODE(folder.stat().st_mode) == stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    folder.chmod(0o755)
    assert "is not a private folder of this user; remove it or set XDG_RUNTIME_DIR" in refused()


def test_without_a_runtime_folder_the_user_is_a_number(base, monkeypatch):
    for name in ("XDG_RUNTIME_DIR", "HOME", "LOGNAME", "LNAME", "USERNAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("USER", "../nobody")
    monkeypatch.setattr(tempfile, "tempdir", str(base))
    assert sockets.socket_folder("w") == base / f"phototaxis-{os.getuid()}" / "w"


def test_without_any_folder_for_temporary_files(monkeypatch):
    def none():
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr(tempfile, "gettempdir", none)
    assert "no folder for temporary files can be written to" in refused()


def test_a_runtime_folder_that_cannot_be_used(base, monkeypatch):
    (base / "file").touch()
    for value, why in (("here/and/there", "no absolute path"), (str(base / "file"), "Not a directory")):
        monkeypatch.setenv("XDG_RUNTIME_DIR", value)
        assert why in refused()

    def deny(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base / "new"))
    monkeypatch.setattr(Path, "mkdir", deny)
    assert f"{base}/new/phototaxis: Permission denied; set XDG_RUNTIME_DIR" in refused()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives a folder away")
def test_a_runtime_folder_of_somebody_else(base):
    os.chown(base, 12345, 12345)
    assert f"XDG_RUNTIME_DIR is {base}, which belongs to the user with the number 12345" in refused()
    assert list(base.iterdir()) == []


@pytest.mark.parametrize("odd", ["#", "?", os.fsdecode(b"\xff")])
def test_a_path_that_no_endpoint_can_name(base, monkeypatch, odd):
    monkeypatch.setenv("XDG_RUNTIME_DIR", f"{base}/a{odd}b")
    assert "a Zenoh endpoint cannot name" in refused()


@pytest.mark.parametrize("odd", [" ", ";", "=", "%20", "ü", "|", "'", '"', "$", "*", "[", "\\", ":"])
def test_a_path_with_other_characters_serves(base, monkeypatch, odd):
    monkeypatch.setenv("XDG_RUNTIME_DIR", f"{base}/a{odd}b")
    with open_session("sim", BusOptions(name="w")):
        assert sockets.in_use(sockets.socket_folder("w") / "sim")
        with pytest.raises(Unavailable, match="a sim is already running in the world 'w'"):
            open_session("sim", BusOptions(name="w"))


def test_bytes_are_counted_and_every_socket_has_room(base, monkeypatch):
    long = Path(f"{base}/{'ü' * 40}"[: WHOLE - 40])
    letters = WHOLE - len(os.fsencode(long)) - len("/phototaxis/")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(long))
    name = "n" * letters
    with open_session("agent", BusOptions(name=name), "i" * 65), open_session("recorder", BusOptions(name=name)):
        pass
    assert f"has {WHOLE + 1} bytes, too long for a Unix socket (at most {WHOLE})" in refused(name + "n")


def test_what_the_system_says_is_told(base):
    (sockets.socket_folder("w") / "sim.lock").mkdir()
    with pytest.raises(Unavailable, match=r"the bus cannot be opened: .*Is a directory"):
        open_session("sim", BusOptions(name="w"))


def test_sockets_of_killed_processes_are_no_hindrance(base):
    folder = sockets.socket_folder("w")
    for path in (folder / "sim", sockets.agent_socket(folder, "dead")):
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(str(path))
        path.with_name(path.name + ".lock").touch()
    with open_session("sim", BusOptions(name="w")), open_session("agent", BusOptions(name="w"), "one"):
        assert not sockets.agent_socket(folder, "dead").exists()
        with pytest.raises(Unavailable, match=r"an agent 'one' is already running in the world 'w'; .* --ident"):
            open_session("agent", BusOptions(name="w"), "one")


def test_agents_that_start_together_open_one_after_another(base, monkeypatch):
    opened = zenoh.open

    def watched(config):
        descriptor = os.open(sockets.socket_folder("w"), os.O_RDONLY)
        with pytest.raises(BlockingIOError):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.close(descriptor)
        return opened(config)

    monkeypatch.setattr(session.zenoh, "open", watched)
    open_session("agent", BusOptions(name="w"), "one").close()


@pytest.mark.parametrize("name", ["..", ".", ".hidden", "-x", "a/b", "", "a b", "ä", "a\n", "n" * 41])
def test_a_world_is_no_path_and_no_option(name):
    with pytest.raises(UserError, match="--name"):
        parse(BusOptions, [f"--name={name}"], "phototaxis", "")


@pytest.mark.parametrize("name", ["a", "_a", "7", "a..b", "a.b-c_d", "n" * 40])
def test_other_names_serve(name):
    assert parse(BusOptions, [f"--name={name}"], "phototaxis", "").name == name
