"""Writes files safely: paths are tested before the work begins, and a file is written whole or not at all.

Errors are one line with the path and the reason. A path that can never be written is bad input (`UserError`,
exit code 2); a full disk, and a failure after the work has begun, is `Unavailable` (exit code 3).
"""

import errno
import os
import secrets
from contextlib import suppress
from pathlib import Path

from phototaxis.runtime.errors import Unavailable, UserError

FULL_ERRNOS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""Error numbers for a full disk, an exceeded quota, a file size limit, and a broken disk."""
_BLOCK = bytes(4096)
"""Test data for `check_writable`: not empty, because a full disk still accepts empty files."""


def check_writable(path: Path, option: str) -> None:
    """Check before the work begins that `write_atomic` can write this file; `option` names it in errors.

    Raises
    ------
    UserError
        when the folder does not exist, or the file cannot be written.
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
    """Check that a folder exists or can be made, and that files can be written in it; errors as in `check_writable`.

    With `keep`, a folder that this check had to make is kept.
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
    """Make a folder that `check_folder_writable` has accepted; raise `Unavailable` if that now fails."""
    try:
        folder.mkdir(mode, parents=True, exist_ok=True)
    except OSError as error:
        raise write_failure(folder, error) from None


def write_atomic(path: Path, data: bytes) -> None:
    """Write a file; a reader sees the old one or the new one, never a part. Devices and pipes are written in place.

    Raises
    ------
    Unavailable
        when the file cannot be written; the old file is then unchanged.
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
    """Append to a file; on an `OSError` nothing of `data` stays in it."""
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
    """Call `os.write` until all is written: a nearly full disk accepts a part without an error."""
    while data:
        data = data[os.write(file, data) :]


def write_failure(path: Path, error: OSError) -> Unavailable:
    """The error for a file that could not be written."""
    return Unavailable(f"{path}: {error.strerror}")


def _try(path: Path) -> None:
    if path.is_fifo():
        return  # opening a pipe would wait for its reader
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
    """Whether the path is a device or a pipe, which must be written in place and not replaced."""
    return path.exists() and not path.is_file()


def _beside(path: Path) -> Path:
    """A temporary path beside the target, different for each writer; links are resolved so that they stay links."""
    target = Path(os.path.realpath(path))
    return target.with_name(f"{target.name}.{secrets.token_hex(4)}.new")


def _refused(path: Path, option: str, error: OSError) -> UserError:
    if error.errno in FULL_ERRNOS:
        return Unavailable(f"{option} {path}: {error.strerror}; free some space, or choose another place")
    why = "Not a directory" if isinstance(error, FileExistsError) else error.strerror
    return UserError(f"{option} {path}: {why}; choose another place")
