"""A journal: what happened since the last checkpoint, so that a killed process continues where it was.

Frames are a 4-byte little-endian length, a 4-byte CRC and the payload. The first frame is the header.
A frame torn by the kill is ignored. Written to the operating system before the effect is published,
which survives the death of the process (not that of the machine).
"""

import os
import struct
import zlib
from pathlib import Path

_FRAME = struct.Struct("<II")


class Journal:
    """An append-only file that is begun anew at each checkpoint."""

    def __init__(self, path: Path):
        self._path = path
        self._file: int | None = None

    def read(self) -> list[bytes]:
        """Header and entries of the journal on disk; [] where there is none."""
        try:
            data = self._path.read_bytes()
        except FileNotFoundError:
            return []
        frames, at = [], 0
        while at + _FRAME.size <= len(data):
            length, crc = _FRAME.unpack_from(data, at)
            frame = data[at + _FRAME.size : at + _FRAME.size + length]
            if len(frame) < length or zlib.crc32(frame) != crc:
                break
            frames.append(frame)
            at += _FRAME.size + length
        return frames

    def begin(self, header: bytes) -> None:
        """Replace the journal, atomically, by one that holds the header alone."""
        self.close()
        fresh = self._path.with_suffix(self._path.suffix + ".new")
        self._file = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o600)
        self.append(header)
        os.replace(fresh, self._path)

    def append(self, payload: bytes) -> None:
        """Add one entry."""
        if self._file is None:
            raise ValueError("begin() comes first")
        os.write(self._file, _FRAME.pack(len(payload), zlib.crc32(payload)) + payload)

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None
