"""Counter-based noise: the same (seed, tick) gives the same numbers, in any process and any language."""

import hashlib
import struct

import numpy as np

_COUNTER = struct.Struct("<qq")


def uniform(seed: int, tick: int, count: int) -> np.ndarray:
    """`count` numbers uniform in −1..1: SHAKE-128 of the two little-endian 64-bit counters, as 64-bit words."""
    words = hashlib.shake_128(_COUNTER.pack(seed, tick)).digest(8 * count)
    return (np.frombuffer(words, "<u8") >> 11) * 2.0**-52 - 1.0
