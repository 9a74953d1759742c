"""Connects our quantities to the variables of an FMU, and converts their units."""

import math
import re
from collections.abc import Container, Mapping
from typing import NamedTuple

from fmpy.model_description import ModelVariable, Unit
from phototaxis.runtime.errors import UserError

from phototaxis_fmu.description import Fmu
from phototaxis_fmu.instance import Parameter
from phototaxis_fmu.start import start_value

DIMENSIONS = ("kg", "m", "s", "A", "K", "mol", "cd")  # an angle has none
REAL = {2: ("Real",), 3: ("Float64", "Float32")}
BEAMS = 16


class Port(NamedTuple):
    """One of our quantities: an input that we give to an FMU, or an output that we take."""

    name: str
    unit: str
    """m, rad or 1."""
    about: str


class Suite(NamedTuple):
    """The inputs and the output of the models for one kind of sensor."""

    name: str
    inputs: tuple[Port, ...]
    output: Port
    raw: Port
    """The input of a filter, which is a model with one input and one output of any name."""
    width: int
    """Most sensors that one instance can compute, as an array or as numbered scalars."""


RAW = Port("raw", "1", "the built-in model's reading, 0..1")
RANGE = Port("range", "m", "distance from the robot's rim to what the beam meets, at most the sonar range")
SUITES = {
    suite.name: suite
    for suite in (
        Suite(
            "light",
            (
                Port("distance", "m", "distance from the sensor to the lamp"),
                Port("bearing", "rad", "direction of the lamp: 0 straight ahead, positive to the left"),
                Port("brightness", "1", "brightness of the lamp"),
                Port("visibility", "1", "1: in sight; 0: hidden"),
                RAW,
            ),
            Port("reading", "1", "0 dark to 1 at the light"),
            RAW,
            1,
        ),
        Suite("sonar", (RANGE,), Port("reading", "m", "the measured range"), RANGE, BEAMS),
    )
}


class Wire(NamedTuple):
    """The connection of one of our quantities to a variable of the FMU: theirs = factor · ours + offset."""

    port: str
    variable: ModelVariable
    factor: float
    offset: float


class Wiring(NamedTuple):
    """The connections and start values of one instance of an FMU."""

    inputs: list[Wire]
    outputs: list[Wire]
    parameters: list[Parameter]

    @property
    def width(self) -> int:
        """Number of sensors that one instance computes."""
        return sum(map(size, self.outputs))

    @property
    def ports(self) -> list[str]:
        """The names of our inputs that are connected, each once."""
        return list(dict.fromkeys(wire.port for wire in self.inputs))


def connect(fmu: Fmu, suite: Suite, names: Mapping[str, str], parameters: Mapping[str, str]) -> Wiring:
    """Find the FMU's variables for our quantities.

    `names` maps our names to the FMU's where they differ. An FMU with one real input and one real output needs no
    names. Numbered scalars are found too: range[0], range[1], … or range_0, range_1, … (from 0 or from 1).

    Raises
    ------
    UserError
        when a variable is missing, or has the wrong causality, type, size or unit.
    """
    known = {port.name: port for port in (*suite.inputs, suite.output)}
    for ours in names:
        if ours not in known:
            raise UserError(f"--fmu-map {ours}=…: the {suite.name} model has no '{ours}', but {', '.join(known)}")
    start = [start_value(fmu, *pair) for pair in parameters.items()]  # first, as they may change the sizes of arrays
    inputs = [wire for port in suite.inputs for wire in _find(fmu, suite, port, "input", names)]
    if not inputs:
        inputs = _only(fmu, suite.raw, "input", parameters)
    outputs = _find(fmu, suite, suite.output, "output", names) or _only(fmu, suite.output, "output")
    for wire in inputs:
        if wire.variable.name in parameters:
            raise UserError(f"{fmu.file}: {wire.variable.name} gets our {wire.port}, so --fmu-param cannot set it")
    wiring = Wiring(inputs, outputs, start)
    if suite.raw.name in wiring.ports and len(wiring.ports) > 1:
        raise UserError(f"{fmu.file}: a filter of {suite.raw.name} cannot have the input {wiring.ports[0]} too")
    if len({wiring.width, *(_count(wiring, port) for port in wiring.ports)}) > 1:
        counts = ", ".join(f"{port} {_count(wiring, port)}" for port in wiring.ports)
        raise UserError(f"{fmu.file}: needs as many readings as inputs; it has {wiring.width} for {counts}")
    return wiring


def _count(wiring: Wiring, port: str) -> int:
    return sum(size(wire) for wire in wiring.inputs if wire.port == port)


def size(wire: Wire) -> int:
    """Return the number of values of a wire: more than 1 for an array."""
    return _size(wire.variable)


def _size(variable: ModelVariable) -> int:
    return math.prod(variable.shape or (1,))


def _find(fmu: Fmu, suite: Suite, port: Port, causality: str, names: Mapping[str, str]) -> list[Wire]:
    """Find the variables for one of our quantities: one or several numbered ones; none is an error only if named."""
    theirs = names.get(port.name, port.name)
    plain = fmu.variable(theirs)
    found = [plain] if plain else _numbered(fmu, theirs)
    if not found and port.name in names:
        raise UserError(f"{fmu.file}: has no variable '{theirs}'; its {causality}s are {fmu.listed(causality)}")
    for variable in found:
        _fits(fmu, variable, causality)
    if found and sum(map(_size, found)) not in (1, suite.width):
        allowed = f"1 or {suite.width}" if suite.width > 1 else "1"
        raise UserError(f"{fmu.file}: {theirs} has {sum(map(_size, found))} values; it must have {allowed}")
    return [_wire(fmu, port, variable) for variable in found]


def _numbered(fmu: Fmu, name: str) -> list[ModelVariable]:
    pattern = re.compile(re.escape(name) + r"(?:\[(\d+)\]|_(\d+))")
    found: dict[int, ModelVariable] = {}
    for variable in fmu.description.modelVariables:
        if match := pattern.fullmatch(variable.name):
            found[int(match[1] or match[2])] = variable
    numbers = sorted(found)
    gapless = numbers in (list(range(len(numbers))), list(range(1, len(numbers) + 1)))
    return [found[number] for number in numbers] if gapless else []


def _only(fmu: Fmu, port: Port, causality: str, given: Container[str] = ()) -> list[Wire]:
    """Find the only real input or output, apart from the variables in `given`, which have a start value."""
    real = [
        variable
        for variable in fmu.description.modelVariables
        if variable.causality == causality
        and variable.type in REAL[fmu.version]
        and _size(variable) == 1
        and variable.name not in given
    ]
    if len(real) != 1:
        raise UserError(
            f"{fmu.file}: no variable is called {port.name}, and it is not clear which {causality} to use; "
            f"add --fmu-map {port.name}=NAME; its {causality}s are {fmu.listed(causality)}"
        )
    return [_wire(fmu, port, real[0])]


def _fits(fmu: Fmu, variable: ModelVariable, causality: str) -> None:
    if variable.causality != causality:
        raise UserError(f"{fmu.file}: {variable.name} has causality {variable.causality}; it must be {causality}")
    if variable.type not in REAL[fmu.version]:
        raise UserError(
            f"{fmu.file}: {variable.name} has type {variable.type}; it must be {' or '.join(REAL[fmu.version])}"
        )


def _wire(fmu: Fmu, port: Port, variable: ModelVariable) -> Wire:
    """Connect a quantity to a variable and convert the unit.

    The FMU declares SI = factor · theirs + offset, so theirs = (ours − offset) / factor.
    """
    unit = declared_unit(variable)
    if unit in (None, "", port.unit):
        return Wire(port.name, variable, 1.0, 0.0)
    definition = next((one for one in fmu.description.unitDefinitions if one.name == unit), None)
    dimensions = {port.unit: 1} if port.unit == "m" else {}
    if definition is None or definition.baseUnit is None or _dimensions(definition) != dimensions:
        raise UserError(f"{fmu.file}: the unit of {variable.name}, {unit}, cannot be converted from {port.unit}")
    base = definition.baseUnit
    factor, offset = base.factor, 0.0 if variable.relativeQuantity else base.offset
    if not factor or not all(map(math.isfinite, (factor, 1 / factor, offset / factor))):
        raise UserError(f"{fmu.file}: the unit of {variable.name}, {unit}, has factor {factor:g}, offset {offset:g}")
    return Wire(port.name, variable, 1 / factor, -offset / factor)


def declared_unit(variable: ModelVariable) -> str | None:
    """Return the unit of a variable or of its declared type."""
    return variable.unit or (variable.declaredType.unit if variable.declaredType else None)


def _dimensions(unit: Unit) -> dict[str, int]:
    return {name: getattr(unit.baseUnit, name) for name in DIMENSIONS if getattr(unit.baseUnit, name)}
