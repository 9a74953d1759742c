"""Reading arenas: by the name of a shipped one, or from a TOML file."""

import re
from importlib import resources
from pathlib import Path

import msgspec
from phototaxis.arena import Arena
from phototaxis.errors import UserError
from phototaxis.words import known, plain

_FOLDER = resources.files("phototaxis_sim") / "arenas"
_LIMIT = 16_000_000


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
    if not path.is_file():
        raise UserError(f"no arena '{name}': neither a file nor one that is shipped; {known(name, shipped())}")
    if path.stat().st_size > _LIMIT:
        raise UserError(f"{name}: larger than {_LIMIT} bytes, not an arena")
    try:
        return parse(path.read_text("utf-8-sig"), name)
    except UnicodeDecodeError:
        raise UserError(f"{name}: not a text file in UTF-8") from None


def parse(text: str, source: str) -> Arena:
    """The arena in a TOML text; `source` names it in errors."""
    try:
        arena = msgspec.toml.decode(text, type=Arena)
    except msgspec.ValidationError as error:
        raise UserError(f"{source}: {_explain(str(error))}") from None
    except msgspec.DecodeError as error:
        raise UserError(f"{source}: not TOML: {error}") from None
    problem = next(iter(_problems(arena)), None)
    if problem:
        raise UserError(f"{source}: {problem}")
    return arena


def _explain(text: str) -> str:
    """msgspec's words with the key in front: `robot.wheels: unknown key`."""
    what, _, where = text.partition(" - at `$")
    where = where.rstrip("`").lstrip(".").removeprefix("$.")
    unknown = re.fullmatch(r"Object contains unknown field `(.*)`", what)
    if unknown:
        key = ".".join(filter(None, [where, unknown[1]]))
        return f"{key}: unknown key"
    missing = re.fullmatch(r"Object missing required field `(.*)`", what)
    if missing:
        return f"{'.'.join(filter(None, [where, missing[1]]))}: missing"
    return f"{where}: {plain(what)}"


def _problems(arena: Arena) -> list[str]:
    """What is well-formed and yet no world; the first is told."""
    found = []
    for index, wall in enumerate(arena.walls):
        if wall.start == wall.end:
            found.append(f"walls[{index}]: expected two different points, start and end are both {list(wall.start)}")
    for index, polygon in enumerate(arena.polygons):
        turns = set()
        corners = polygon.corners
        for a, b, c in zip(corners, corners[1:] + corners[:1], corners[2:] + corners[:2], strict=True):
            turns.add(_sign((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])))
        if turns not in ({1}, {-1}):
            found.append(f"polygons[{index}].corners: expected a convex polygon without corners on a line")
    width, height = arena.size
    for index, light in enumerate(arena.lights):
        x, y = light.position
        if not (0 <= x <= width and 0 <= y <= height):
            found.append(f"lights[{index}].position: expected a place inside the room, 0..{width} × 0..{height}")
    period, step = arena.motion.control_period, arena.motion.physics_step
    if arena.physics_steps < 1 or abs(arena.physics_steps * step - period) > 1e-9 * period:
        found.append(f"motion.physics_step: expected a whole fraction of control_period = {period}, got {step}")
    return found


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)
