"""A learner's whole state, on disk or on the bus: complete, written atomically, safe to load.

The file is a NumPy .npz without pickles: the learner's arrays, and `meta`, the rest as JSON bytes.
"""

import hashlib
import io
import zipfile
import zlib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from msgspec import Struct

from phototaxis.disk import write_whole
from phototaxis.errors import UserError
from phototaxis.messages import End, Motor

FORMAT = 1
_LIMIT = 1_000_000_000


class Meta(Struct, forbid_unknown_fields=True, kw_only=True):
    """Everything about an agent but its learner's arrays."""

    format: int = FORMAT
    learner: str
    percept: str
    reward: str
    cap: int
    hyperparameters: dict[str, Any]
    exploration: dict[str, Any]
    budget: int
    """Learning steps that falling rates and temperatures are spread over."""
    run: str
    tick: int
    """The last tick that was answered; −1 for none."""
    episode: int
    epoch: int
    steps: int
    lights: list[tuple[float, float]]
    """The percept's history."""
    state: tuple[float, ...]
    """The last state: percept and learner's context; empty for none."""
    linked: bool
    """Whether the last step was learned from, so that the next one continues it."""
    answer: tuple[Motor, Motor, End] | None
    """The motor command and the end of the episode with which that tick was answered."""
    random: dict[str, Any]
    """State of the random generator, its large numbers as text."""
    visits: list[int]
    """How often each percept was met."""
    arena: str
    learner_hash: str


def learner_hash(arrays: dict[str, np.ndarray]) -> str:
    """A digest of what was learned: names, types, shapes and bytes of the arrays."""
    digest = hashlib.blake2b(digest_size=8)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def encode(meta: Meta, arrays: dict[str, np.ndarray]) -> bytes:
    """A checkpoint as the bytes of a file."""
    buffer = io.BytesIO()
    named: dict[str, Any] = {"meta": np.frombuffer(msgspec.json.encode(meta), np.uint8), **arrays}
    np.savez(buffer, **named)
    return buffer.getvalue()


def decode(data: bytes, source: str) -> tuple[Meta, dict[str, np.ndarray]]:
    """A checkpoint from the bytes of a file; `source` names it.

    Raises
    ------
    UserError
        when they are truncated, too large, or not a checkpoint of this format.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _LIMIT:
                raise UserError(f"{source}: unpacks to more than {_LIMIT} bytes, not loaded")
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        meta = msgspec.json.decode(arrays.pop("meta").tobytes(), type=Meta)
    except (zipfile.BadZipFile, EOFError, zlib.error) as error:
        raise UserError(f"{source}: not a checkpoint, or truncated: {error}") from None
    except (KeyError, ValueError, OSError, msgspec.MsgspecError) as error:
        raise UserError(f"{source}: not a Phototaxis checkpoint: {error}") from None
    if meta.format != FORMAT:
        raise UserError(f"{source}: checkpoint format {meta.format}, this version reads {FORMAT}")
    if learner_hash(arrays) != meta.learner_hash:
        raise UserError(f"{source}: the contents do not match their hash; the file is damaged")
    return meta, arrays


def save(path: Path, meta: Meta, arrays: dict[str, np.ndarray]) -> None:
    """Write a checkpoint; a reader sees the old file or the new one, never a part.

    Raises
    ------
    Unavailable
        when it cannot be written; an older one is then still there.
    """
    write_whole(path, encode(meta, arrays))


def load(path: Path) -> tuple[Meta, dict[str, np.ndarray]]:
    """Read a checkpoint.

    Raises
    ------
    UserError
        when the file is missing, or as in `decode`.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise UserError(f"{path}: no such checkpoint") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None
    return decode(data, str(path))
