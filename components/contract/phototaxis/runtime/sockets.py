"""The Unix sockets of a world on this machine: their private folder, and whether a process listens on one."""

import fcntl
import hashlib
import os
import stat
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from phototaxis.runtime.errors import Unavailable

MAX_PATH_BYTES = 103
"""Longest path of a Unix socket, in bytes, that all systems accept (macOS 103, Linux 107)."""
MAX_SOCKET_NAME_BYTES = len("/agent-") + 16
"""Longest name of a socket in its folder, in bytes."""
ADVICE = "set XDG_RUNTIME_DIR to another folder of yours"


def socket_folder(name: str) -> Path:
    """The private folder (mode 0700) that holds the Unix sockets of one world; make it if it is missing.

    Raises
    ------
    Unavailable
        when the folder cannot be made, belongs to another user, is accessible to others, or has a path that no
        Zenoh endpoint can name.
    """
    root = _root()
    folder = root / name
    _refuse_unspeakable(folder)
    for part in (root, folder):
        try:
            part.mkdir(mode=0o700, parents=True, exist_ok=True)
            info = part.lstat()
        except OSError as error:
            raise Unavailable(
                f"no folder for the sockets of this machine: {part}: {os.strerror(error.errno or 0)}; {ADVICE}"
            ) from None
        if not stat.S_ISDIR(info.st_mode) or info.st_uid != os.getuid() or info.st_mode & 0o077:
            raise Unavailable(f"{part} is not a private folder of this user; remove it or {ADVICE}")
    return folder


def _root() -> Path:
    """The folder of all worlds of this user: in XDG_RUNTIME_DIR, or else in the folder for temporary files."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    if not base:
        try:
            return Path(tempfile.gettempdir()) / f"phototaxis-{os.getuid()}"
        except OSError:
            raise Unavailable(f"no folder for temporary files can be written to; {ADVICE}") from None
    if not os.path.isabs(base):
        raise Unavailable(f"XDG_RUNTIME_DIR is '{base}', which is no absolute path; {ADVICE}")
    try:
        owner = os.stat(base).st_uid
    except OSError:
        owner = os.getuid()  # making our folder in it will report the fault
    if owner not in (os.getuid(), 0):
        raise Unavailable(f"XDG_RUNTIME_DIR is {base}, which belongs to the user with the number {owner}; {ADVICE}")
    return Path(base) / "phototaxis"


def _refuse_unspeakable(folder: Path) -> None:
    """Raise Unavailable where the path is too long for a socket or has characters that end an endpoint."""
    path = os.fsencode(folder)
    for letter in b"#?":
        if letter in path:
            raise Unavailable(f"{folder} holds '{chr(letter)}', which a Zenoh endpoint cannot name; {ADVICE}")
    try:
        path.decode()
    except UnicodeDecodeError:
        raise Unavailable(f"{folder} is not in UTF-8, so that a Zenoh endpoint cannot name it; {ADVICE}") from None
    room = MAX_PATH_BYTES - MAX_SOCKET_NAME_BYTES
    if len(path) > room:
        raise Unavailable(
            f"{folder} has {len(path)} bytes, too long for a Unix socket (at most {room}); "
            "set XDG_RUNTIME_DIR to a shorter one"
        )


def agent_socket(folder: Path, ident: str) -> Path:
    """The socket of one agent: a digest of its name on the bus, which may be too long for a path."""
    return folder / f"agent-{hashlib.blake2b(ident.encode(), digest_size=8).hexdigest()}"


def in_use(socket: Path) -> bool:
    """Whether a living process listens on a socket: until it ends, Zenoh locks the file beside the socket."""
    try:
        with _lock_file(socket).open() as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


@contextmanager
def startup_lock(folder: Path) -> Generator[None]:
    """Let only one agent at a time remove stale sockets and open its own: a socket that exists but is not locked
    yet looks like one that a killed agent left."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def remove_stale_sockets(folder: Path) -> None:
    """Remove the sockets of killed agents, whose locks no process holds."""
    for lock in folder.glob("agent-*.lock"):
        socket = lock.with_suffix("")
        if not in_use(socket):
            socket.unlink(missing_ok=True)
            lock.unlink(missing_ok=True)


def _lock_file(socket: Path) -> Path:
    return socket.with_name(socket.name + ".lock")
