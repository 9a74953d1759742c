"""Assigns each option NAME=VALUE to an FMU, and finds where NAME ends: a variable may be called a.b or a=b."""

from collections.abc import Mapping, Sequence

from phototaxis.runtime.errors import UserError

from phototaxis_fmu.description import Fmu
from phototaxis_fmu.wiring import SUITES

Pairs = dict[str, dict[str, str]]


def assign(maps: Sequence[str], parameters: Sequence[str], fmus: Mapping[str, Fmu]) -> tuple[Pairs, Pairs]:
    """Return the --fmu-map and the --fmu-param pairs of each FMU, by its kind ("light" or "sonar").

    Raises
    ------
    UserError
        when an option is not NAME=VALUE, or does not say which FMU it is for.
    """
    ours = {port.name for suite in SUITES.values() for port in (*suite.inputs, suite.output)}
    known = {kind: {one.name for one in fmu.description.modelVariables} for kind, fmu in fmus.items()}
    return _pairs("fmu-map", maps, dict.fromkeys(fmus, ours)), _pairs("fmu-param", parameters, known)


def _pairs(flag: str, items: Sequence[str], known: Mapping[str, set[str]]) -> Pairs:
    found: Pairs = {kind: {} for kind in known}
    for item in items:
        if not known:
            raise UserError(f"--{flag} {item}: there is no FMU; give --light-fmu or --sonar-fmu")
        kind, name, value = _one(flag, item, known)
        found[kind][name] = value
    return found


def _one(flag: str, item: str, known: Mapping[str, set[str]]) -> tuple[str, str, str]:
    """Split one option into the FMU's kind, the name and the value."""
    splits = [(item[:at], item[at + 1 :]) for at, letter in enumerate(item) if letter == "=" and at]
    if not splits:
        raise UserError(f"--{flag} {item}: expected NAME=VALUE")
    only = next(iter(known)) if len(known) == 1 else ""
    for name, value in reversed(splits):  # the longest known name first
        if only and name in known[only]:
            return only, name, value
        kind, _, rest = name.partition(".")
        if kind in known and rest in known[kind]:
            return kind, rest, value
    name, value = splits[0]  # the name is unknown; `connect` rejects it and lists the FMU's own names
    kind, dot, rest = name.partition(".")
    if dot and kind in known:
        return kind, rest, value
    if dot and kind in SUITES:
        raise UserError(f"--{flag} {item}: there is no --{kind}-fmu")
    if not only:
        raise UserError(f"--{flag} {item}: for which FMU? write light.{name}=… or sonar.{name}=…")
    return only, name, value
