"""This machine's own sockets: the private folder of a world, and who listens there."""

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
"""Bytes of a Unix socket's path that every system takes (macOS; Linux takes 107)."""
MAX_SOCKET_NAME_BYTES = len("/agent-") + 16
"""Bytes of the longest name that a socket has in its folder."""
ADVICE = "set XDG_RUNTIME_DIR to another folder of yours"


def socket_folder(name: str) -> Path:
    """The private folder (mode 0700) that holds the Unix sockets of one world; made where missing.

    Raises
    ------
    Unavailable
        when the folder cannot be made, belongs to somebody else, lets others in, or has a path that no
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
    """The folder of all worlds of this user: in XDG_RUNTIME_DIR, or where temporary files are."""
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
        owner = os.getuid()  # it is missing, or what is wrong with it shows when we make our folder in it
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
    """Whether a living process listens there: Zenoh holds a lock on the file beside a socket until its process ends."""
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
    """Agents that start at the same moment sweep and open one after another: a socket that has just been made,
    but is not yet locked, would look like one that a killed agent left."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def remove_stale_sockets(folder: Path) -> None:
    """Remove the sockets that killed agents left: nobody holds their locks."""
    for lock in folder.glob("agent-*.lock"):
        socket = lock.with_suffix("")
        if not in_use(socket):
            socket.unlink(missing_ok=True)
            lock.unlink(missing_ok=True)


def _lock_file(socket: Path) -> Path:
    return socket.with_name(socket.name + ".lock")
