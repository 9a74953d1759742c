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

from phototaxis.geometry.arena import Arena
from phototaxis.runtime.disk import write_atomic
from phototaxis.runtime.errors import UserError
from phototaxis.wire.messages import End, Motor

FORMAT = 3
"""The version of what `CheckpointMetadata` holds; other versions are refused."""
_MAX_BYTES = 1_000_000_000
_SPARE_BYTES = 1_000_000
"""Bytes of a file left for everything but the arrays' contents."""
STORABLE_KINDS = "biufcSU"
"""NumPy's codes (`dtype.kind`) of the number and text types that can be read back without pickles."""


class CheckpointMetadata(Struct, forbid_unknown_fields=True, kw_only=True):
    """Everything that a checkpoint holds beside the learner's arrays."""

    format: int = FORMAT
    learner: str
    percept: str
    reward: str
    max_episode_steps: int
    hyperparameters: dict[str, Any]
    exploration: dict[str, Any]
    budget: int
    """Number of learning steps over which learning rates and temperatures fall."""
    run: str
    tick: int
    """The last tick that the agent answered; −1 before the first."""
    episode: int
    epoch: int
    steps: int
    lights: list[tuple[float, float]]
    """The last light readings, as in `LightHistory.lights`."""
    state: tuple[float, ...]
    """The state at the last tick: the percept, then the learner's context; empty before the first."""
    linked: bool
    """Whether the agent learned from the last step, so that the next transition continues it."""
    answer: tuple[Motor, Motor, End] | None
    """The answer to the last tick: left motor, right motor, and the end of the episode."""
    random: dict[str, Any]
    """State of the random generator, its large numbers as text."""
    visits: list[int]
    """How often the agent met each state of the percept."""
    arena: str
    """Name of the arena in which the agent learned last."""
    arena_digest: str
    """`Arena.digest` of the arena in which the agent learned last; "" if it has learned in none."""
    learner_hash: str

    def elsewhere(self, arena: Arena) -> str:
        """A warning text if the agent learned in another arena than this one; else ""."""
        if self.arena_digest == arena.digest:
            return ""
        there, here = f"'{self.arena}' ({self.arena_digest})", f"'{arena.name}' ({arena.digest})"
        return f"learned in the arena {there}, which is another world than {here}"


class _Header(Struct):
    format: int


def learner_hash(arrays: dict[str, np.ndarray]) -> str:
    """A digest of what was learned: names, types, shapes and bytes of the arrays."""
    digest = hashlib.blake2b(digest_size=8)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def storable(arrays: dict[Any, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the arrays after checking that a checkpoint can hold them and be read back.

    Raises
    ------
    UserError
        when a name or a type of number cannot be read back, or all are too large; the text says which.
    """
    for name, array in arrays.items():
        if not isinstance(name, str) or not name.isprintable() or name in ("", "meta") or name.endswith(".npy"):
            raise UserError(f"no array of a checkpoint may be called {name!r}; take a word that says what it holds")
        if array.dtype.kind not in STORABLE_KINDS:
            held = "Python objects" if array.dtype.hasobject else f"the type {array.dtype}"
            raise UserError(f"the array '{name}' holds {held}, which cannot be read back; give numbers")
    total = sum(array.nbytes for array in arrays.values())
    if total > _MAX_BYTES - _SPARE_BYTES:
        raise UserError(
            f"the arrays have {total} bytes, which is too much: at most {_MAX_BYTES - _SPARE_BYTES} are read back"
        )
    return arrays


def encode(meta: CheckpointMetadata, arrays: dict[str, np.ndarray]) -> bytes:
    """A checkpoint as the bytes of a file.

    Raises
    ------
    UserError
        when `decode` could not read it.
    """
    text = msgspec.json.encode(meta)
    try:
        msgspec.json.decode(text, type=CheckpointMetadata)
    except msgspec.MsgspecError as error:  # numbers that are not finite are null in JSON
        raise UserError(f"cannot be kept in a checkpoint: {error}") from None
    named = {"meta": np.frombuffer(text, np.uint8), **storable(arrays)}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in named.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)
    return buffer.getvalue()


def decode(data: bytes, source: str) -> tuple[CheckpointMetadata, dict[str, np.ndarray]]:
    """A checkpoint from the bytes of a file; `source` names it.

    Raises
    ------
    UserError
        when they are truncated, too large, or not a checkpoint of this format.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _MAX_BYTES:
                raise UserError(f"{source}: unpacks to more than {_MAX_BYTES} bytes, not loaded")
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        text = arrays.pop("meta").tobytes()
        written = msgspec.json.decode(text, type=_Header).format
        if written != FORMAT:
            age = "an older" if written < FORMAT else "a newer"
            raise UserError(f"{source}: made by {age} version (checkpoint format {written}, not {FORMAT}); train again")
        meta = msgspec.json.decode(text, type=CheckpointMetadata)
    except (zipfile.BadZipFile, EOFError, zlib.error) as error:
        raise UserError(f"{source}: not a checkpoint, or truncated: {error}") from None
    except (KeyError, ValueError, OSError, msgspec.MsgspecError) as error:
        raise UserError(f"{source}: not a Phototaxis checkpoint: {error}") from None
    if learner_hash(arrays) != meta.learner_hash:
        raise UserError(f"{source}: the contents do not match their hash; the file is damaged")
    return meta, arrays


def save(path: Path, meta: CheckpointMetadata, arrays: dict[str, np.ndarray]) -> None:
    """Write a checkpoint; a reader sees the old file or the new one, never a part.

    Raises
    ------
    Unavailable
        when the file cannot be written; an older checkpoint is then unchanged.
    """
    write_atomic(path, encode(meta, arrays))


def load(path: Path) -> tuple[CheckpointMetadata, dict[str, np.ndarray]]:
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
