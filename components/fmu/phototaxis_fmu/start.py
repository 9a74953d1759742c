"""Parses the start values of an FMU's variables from options."""

import math
import re
from typing import Any

from fmpy.model_description import ModelVariable
from phototaxis.runtime.errors import UserError

from phototaxis_fmu.description import Fmu
from phototaxis_fmu.instance import Parameter

SETTABLE = ("parameter", "structuralParameter", "input")
BITS = {"Integer": 32, "Int8": 8, "Int16": 16, "Int32": 32, "Int64": 64}
SIGNED = {kind: (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for kind, bits in BITS.items()}
UNSIGNED = {f"U{kind}": (0, 2**bits - 1) for kind, bits in BITS.items()}
WHOLE = {**SIGNED, **UNSIGNED}
SINGLE = 3.4028234663852886e38
"""The largest number of Float32."""
TRUTH = {"true": True, "1": True, "false": False, "0": False}


def start_value(fmu: Fmu, name: str, text: str) -> Parameter:
    """Parse the start value of a variable; a structural parameter also changes the sizes of arrays in `fmu`.

    Raises
    ------
    UserError
        when there is no such variable, or the value does not fit it.
    """
    variable = fmu.variable(name)
    if variable is None or variable.causality not in SETTABLE:
        there = fmu.listed("parameter", "structuralParameter")
        raise UserError(f"{fmu.file}: has no parameter '{name}'; its parameters are {there}")
    said = f"--fmu-param {name}={text}"
    if variable.type in ("Binary", "Clock"):
        raise UserError(f"{said}: {name} is of type {variable.type}, which cannot be set")
    parts = [text]
    if variable.shape:
        parts = text.split(",") if variable.type == "String" else re.split(r"[,\s]+", text.strip())
        wanted = math.prod(variable.shape)
        parts = parts * wanted if len(parts) == 1 else parts
        if len(parts) != wanted:
            raise UserError(f"{said}: {name} has {wanted} values; give {wanted}, or one for all")
    values = [_value(said, variable, part) for part in parts]
    structural = variable.causality == "structuralParameter"
    if structural:
        _resize(fmu, variable, values[0])
    return Parameter(variable.type, variable.valueReference, values, structural)


def bounds(variable: ModelVariable) -> tuple[float, float]:
    """Return the declared minimum and maximum of a variable or of its type; infinite where there is none."""
    low = variable.min or (variable.declaredType.min if variable.declaredType else None)
    high = variable.max or (variable.declaredType.max if variable.declaredType else None)
    return -math.inf if low is None else float(low), math.inf if high is None else float(high)


def _value(said: str, variable: ModelVariable, text: str) -> int | float | bool | str:
    kind = variable.type
    try:
        if kind == "Boolean":
            return TRUTH[text.lower()]
        if kind == "String":
            text.encode()
            return text
        value: Any = _item(variable, text) if kind == "Enumeration" else int(text) if kind in WHOLE else float(text)
    except UnicodeError:
        raise UserError(f"{said!a}: not valid UTF-8") from None
    except (ValueError, KeyError):
        needed = f", one of {', '.join(_items(variable))}" if kind == "Enumeration" else ""
        raise UserError(f"{said}: {variable.name} is of type {kind}{needed}") from None
    low, high = WHOLE.get(kind, (-SINGLE, SINGLE) if kind == "Float32" else (-math.inf, math.inf))
    if not low <= value <= high or math.isinf(value):
        raise UserError(f"{said}: {variable.name} is of type {kind}, which cannot hold this value")
    low, high = bounds(variable)
    if kind != "Enumeration" and not low <= value <= high:
        raise UserError(f"{said}: out of its range {low:g} to {high:g}")
    return value


def _items(variable: ModelVariable) -> dict[str, int]:
    items = variable.declaredType.items if variable.declaredType else []
    return {str(item.name): int(str(item.value)) for item in items}


def _item(variable: ModelVariable, text: str) -> int:
    """Return the value of an enumeration item, given by its name or value."""
    items = _items(variable)
    if text in items:
        return items[text]
    if (value := int(text)) not in items.values():
        raise ValueError
    return value


def _resize(fmu: Fmu, variable: ModelVariable, value: Any) -> None:
    (variable.alias or variable).start = str(value)
    for one in fmu.description.modelVariables:
        sizes = [one.variable.start if one.variable else one.start for one in one.dimensions]
        one.shape = tuple(int(str(size)) for size in sizes)
