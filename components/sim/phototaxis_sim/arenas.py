"""Reading arenas: by the name of a shipped one, or from a TOML file."""

import re
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.errors import UserError, warn
from phototaxis.runtime.phrases import known, plain

from phototaxis_sim.brightness import too_dim
from phototaxis_sim.survey import survey

_FOLDER = resources.files("phototaxis_sim") / "arenas"
_MAX_BYTES = 16_000_000
_surveyed: dict[str, list[str]] = {}
"""Results of `survey`, by the arena's digest."""


def shipped() -> list[str]:
    """Names of the arenas that come with Phototaxis."""
    return sorted(entry.name.removesuffix(".toml") for entry in _FOLDER.iterdir() if entry.name.endswith(".toml"))


def load(name: str) -> Arena:
    """The arena called `name`, or in the file `name`.

    Raises
    ------
    UserError
        one line that names the file, the key and what was expected.
    """
    if name in shipped():
        return parse((_FOLDER / f"{name}.toml").read_text("utf-8"), name)
    path = Path(name)
    try:
        if not path.is_file():
            raise UserError(f"no arena '{name}': neither a file nor one that is shipped; {known(name, shipped())}")
        if path.stat().st_size > _MAX_BYTES:
            raise UserError(f"{name}: larger than {_MAX_BYTES} bytes, not an arena")
        return parse(path.read_text("utf-8-sig"), name)
    except UnicodeDecodeError:
        raise UserError(f"{name}: not a text file in UTF-8") from None
    except (OSError, ValueError) as error:
        raise UserError(f"arena {name!r}: {getattr(error, 'strerror', None) or error}") from None


def load_checked(name: str, goal: bool = True) -> Arena:
    """Load an arena as `load` does, and warn on stderr about anything suspicious in it.

    Without `goal` no light needs to be bright enough to count as reached.

    Raises
    ------
    UserError
        as in `load`; also when the robot fits nowhere, when the light is already reached at nearly all placements,
        and when no light can ever be reached.
    """
    arena = load(name)
    if name in shipped():  # a test checks the shipped arenas
        return arena
    if arena.name in shipped() and arena.digest != load(arena.name).digest:
        warn(f"{name}: name: '{arena.name}' is the name of a shipped arena, and this is another world")
    if dim := too_dim(arena):
        if goal:
            raise UserError(f"{name}: {dim}")
        warn(f"{name}: {dim}")
    try:
        if arena.digest not in _surveyed:
            _surveyed[arena.digest] = survey(arena)
    except UserError as error:
        raise UserError(f"{name}: {error}") from None
    for suspicion in _surveyed[arena.digest]:
        warn(f"{name}: {suspicion}")
    return arena


def parse(text: str, source: str) -> Arena:
    """The arena in a TOML text; `source` names it in errors."""
    try:
        raw = msgspec.toml.decode(text)
    except (msgspec.DecodeError, RecursionError) as error:
        raise UserError(f"{source}: not TOML: {error}") from None
    try:
        return msgspec.convert(raw, Arena)
    except msgspec.ValidationError as error:
        raise UserError(f"{source}: {_explain(str(error), raw)}") from None


def _explain(text: str, raw: Any) -> str:
    """Reword an error of msgspec with the key in front, as in `robot.wheels: unknown key`."""
    what, _, where = text.partition(" - at `$")
    where = where.rstrip("`").lstrip(".").removeprefix("$.")
    unknown = re.fullmatch(r"Object contains unknown field `(.*)`", what)
    if unknown:
        key = ".".join(filter(None, [where, unknown[1]]))
        return f"{key}: unknown key"
    missing = re.fullmatch(r"Object missing required field `(.*)`", what)
    if missing:
        return f"{'.'.join(filter(None, [where, missing[1]]))}: missing"
    if not where:
        return plain(what)
    value = _at(raw, where)
    got = f", got {value!r}" if type(value) in (int, float) else ""
    what = plain(what)
    return f"{where}: {what[0].lower()}{what[1:]}{got}"


def _at(raw: Any, where: str) -> Any:
    """The value at a path such as `walls[0].start[1]`; None where there is none."""
    for key, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", where):
        try:
            raw = raw[key] if key else raw[int(index)]
        except (KeyError, IndexError, TypeError):
            return None
    return raw
