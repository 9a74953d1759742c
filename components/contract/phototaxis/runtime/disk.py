"""The rules of writing to disk: a place is tried before the work begins, and a file is written whole or not at all.

What goes wrong is one line that names the place and says why. A place that can never be written is bad input
(`UserError`, 2); one that is full, and anything that fails after the work has begun, is `Unavailable` (3).
"""

import errno
import os
import secrets
from contextlib import suppress
from pathlib import Path

from phototaxis.runtime.errors import Unavailable, UserError

FULL_ERRNOS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""No space, no quota, a limit on the size of files, a broken disk."""
_BLOCK = bytes(4096)
"""What is written to try a place: a full disk takes empty files."""


def check_writable(path: Path, option: str) -> None:
    """Find out now whether `write_atomic` can write a file later; `option` names it in messages.

    Raises
    ------
    UserError
        when there is no such folder, or the file cannot be written.
    Unavailable
        when the disk is full.
    """
    if not path.parent.is_dir():
        raise UserError(f"{option} {path}: there is no folder {path.parent}")
    try:
        _try(path)
    except OSError as error:
        raise _refused(path, option, error) from None


def check_folder_writable(folder: Path, option: str, keep: bool = False) -> None:
    """Find out now whether a folder is there or can be made, and files be written in it; see `check_writable`.

    With `keep` a folder that had to be made stays.
    """
    made = [part for part in (folder, *folder.parents) if not part.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _try(folder / ".trial")
    except OSError as error:
        keep = False
        raise _refused(folder, option, error) from None
    finally:
        for part in [] if keep else made:
            with suppress(OSError):
                part.rmdir()


def make_folder(folder: Path, mode: int = 0o777) -> None:
    """Make a folder that has been tried, if it is missing; `Unavailable` when that is not possible any more."""
    try:
        folder.mkdir(mode, parents=True, exist_ok=True)
    except OSError as error:
        raise write_failure(folder, error) from None


def write_atomic(path: Path, data: bytes) -> None:
    """Write a file; a reader sees the old one or the new one, never a part. Devices and pipes are written in place.

    Raises
    ------
    Unavailable
        when it cannot be written; the old file is then still there.
    """
    try:
        if _special(path):
            path.write_bytes(data)
            return
        fresh = _beside(path)
        try:
            fresh.write_bytes(data)
            os.replace(fresh, os.path.realpath(path))
        except OSError:
            with suppress(OSError):
                fresh.unlink()
            raise
    except OSError as error:
        raise write_failure(path, error) from None


def append_atomic(path: Path, data: bytes) -> None:
    """Add to the end of a file; what does not fit is an `OSError`, and no part of it stays."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        size = os.fstat(file).st_size
        try:
            write_all(file, data)
        except OSError:
            os.ftruncate(file, size)
            raise
    finally:
        os.close(file)


def write_all(file: int, data: bytes) -> None:
    """`os.write` until everything is written: a nearly full disk takes a part of it without an error."""
    while data:
        data = data[os.write(file, data) :]


def write_failure(path: Path, error: OSError) -> Unavailable:
    """The one line about a file that could not be written."""
    return Unavailable(f"{path}: {error.strerror}")


def _try(path: Path) -> None:
    if path.is_fifo():
        return  # opening it would wait for its reader
    if _special(path):
        with path.open("ab", buffering=0) as device:
            device.write(b"")
        return
    fresh = _beside(path)
    try:
        fresh.write_bytes(_BLOCK)
    finally:
        with suppress(OSError):
            fresh.unlink()


def _special(path: Path) -> bool:
    """Whether it stands for something else than a file's contents, so that it must not be replaced."""
    return path.exists() and not path.is_file()


def _beside(path: Path) -> Path:
    """Where the new contents are written first, by each of several writers; a link stays a link."""
    target = Path(os.path.realpath(path))
    return target.with_name(f"{target.name}.{secrets.token_hex(4)}.new")


def _refused(path: Path, option: str, error: OSError) -> UserError:
    if error.errno in FULL_ERRNOS:
        return Unavailable(f"{option} {path}: {error.strerror}; free some space, or choose another place")
    why = "Not a directory" if isinstance(error, FileExistsError) else error.strerror
    return UserError(f"{option} {path}: {why}; choose another place")
