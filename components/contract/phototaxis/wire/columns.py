"""Turns the columns of batch messages from arrays to little-endian bytes and back, and checks their size."""

import numpy as np

from phototaxis.wire.codec import Refused

REAL, COUNT, FLAG = np.dtype("<f8"), np.dtype("<i8"), np.dtype("u1")


def pack(array: np.ndarray, kind: np.dtype = REAL) -> bytes:
    """An array as bytes, row by row."""
    return np.ascontiguousarray(array, kind).tobytes()


def unpack(data: bytes, robots: int, rows: int = 1, kind: np.dtype = REAL) -> np.ndarray:
    """A read-only array (N,), or (rows, N) for more than one row.

    Raises
    ------
    Refused
        when the number of bytes does not match, or a real number is not finite.
    """
    if len(data) != rows * robots * kind.itemsize:
        raise Refused(f"size: {len(data)} bytes for {rows} × {robots} of {kind.itemsize} bytes")
    array = np.frombuffer(data, kind)
    if kind is REAL and not np.isfinite(array).all():
        raise Refused("value: a number that is not finite")
    return array if rows == 1 else array.reshape(rows, robots)
