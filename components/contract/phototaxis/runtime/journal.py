"""A journal: what happened since the last checkpoint, so that a killed process continues where it was.

Frames are a 4-byte little-endian length, a 4-byte CRC and the payload. The first frame is the header.
A last frame that a kill left incomplete is ignored. An entry is handed to the operating system before its effect
is published: it survives the death of the process, but not that of the machine.
"""

import os
import struct
import zlib
from contextlib import suppress
from pathlib import Path

from phototaxis.runtime.disk import write_all
from phototaxis.runtime.errors import UserError

_FRAME = struct.Struct("<II")
GIVEN_UP = b""
"""The last entry of a journal that could not be continued: later entries are missing. No other entry is empty."""


class Journal:
    """An append-only file that is begun anew at each checkpoint.

    A failed write raises `OSError` and leaves no part in the file. The caller may then try again, or give the
    journal up until the next `begin`.
    """

    def __init__(self, path: Path):
        self.path = path
        self._file: int | None = None
        self._size = 0
        self._header = 0

    @property
    def kept(self) -> bool:
        """Whether the journal is open and complete, so that entries may be appended."""
        return self._file is not None

    def read(self) -> list[bytes]:
        """Read the header and the entries of the journal on disk; [] if there is no file.

        Raises
        ------
        UserError
            when the file cannot be read, is not a journal, or is damaged before its last frame.
        """
        try:
            data = self.path.read_bytes()
        except FileNotFoundError:
            return []
        except OSError as error:
            raise UserError(f"{self.path}: {error.strerror}") from None
        frames, at = list[bytes](), 0
        while at + _FRAME.size <= len(data):
            length, crc = _FRAME.unpack_from(data, at)
            frame = data[at + _FRAME.size : at + _FRAME.size + length]
            if len(frame) < length:
                break
            if zlib.crc32(frame) != crc:
                raise UserError(f"{self.path}: not a journal, or damaged at byte {at}; remove it or name another file")
            frames.append(frame)
            at += _FRAME.size + length
        if data and not frames:
            raise UserError(f"{self.path}: not a journal; remove it or name another file")
        return frames

    def resume(self, frames: list[bytes]) -> None:
        """Continue the journal on disk after these frames; an incomplete frame after them is cut off."""
        file = os.open(self.path, os.O_WRONLY)
        sizes = [_FRAME.size + len(frame) for frame in frames]
        self._adopt(file, sizes[0], sum(sizes))
        os.ftruncate(file, self._size)
        os.lseek(file, self._size, os.SEEK_SET)

    def begin(self, header: bytes) -> None:
        """Replace the journal atomically by one that holds only the header."""
        fresh = self.path.with_name(f"{self.path.name}.new")
        frame = _framed(header)
        try:
            file = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            try:
                write_all(file, frame)
                os.replace(fresh, self.path)
            except OSError:
                os.close(file)
                with suppress(OSError):
                    fresh.unlink()
                raise
        except OSError as error:
            raise self._named(error) from None
        self._adopt(file, len(frame), len(frame))

    def append(self, payload: bytes) -> None:
        """Add one entry."""
        if self._file is None:
            raise ValueError("begin() comes first")
        frame = _framed(payload)
        try:
            write_all(self._file, frame)
        except OSError as error:
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, self._size, os.SEEK_SET)
            raise self._named(error) from None
        self._size += len(frame)

    def give_up(self) -> None:
        """Mark in the file that entries are missing from here on, and free its space; only `begin` opens it again.

        The mark (`GIVEN_UP`) overwrites the first entry, which needs no new disk space. If even that fails, the
        journal is removed.
        """
        if self._file is None:
            return
        try:
            os.lseek(self._file, self._header, os.SEEK_SET)
            write_all(self._file, _framed(GIVEN_UP))
            os.ftruncate(self._file, self._header + _FRAME.size)
        except OSError:
            self.path.unlink(missing_ok=True)
        self.close()

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _adopt(self, file: int, header: int, size: int) -> None:
        self.close()
        self._file, self._header, self._size = file, header, size

    def _named(self, error: OSError) -> OSError:
        return OSError(error.errno, error.strerror, str(self.path))


def _framed(payload: bytes) -> bytes:
    return _FRAME.pack(len(payload), zlib.crc32(payload)) + payload
