"""`phototaxis fmu`: what is in an FMU, does it work as a sensor, and the shipped examples."""

import json
import math
import random
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from fmpy.validation import validate_fmu
from msgspec import Meta, Struct
from phototaxis.arena import Arena, Light
from phototaxis.errors import UserError
from phototaxis.fmu import FmuOptions
from phototaxis.options import parse

from phototaxis_sensors.fmu.build import build
from phototaxis_sensors.fmu.description import Fmu, read
from phototaxis_sensors.fmu.examples import EXAMPLES
from phototaxis_sensors.fmu.sensors import FmuSensors
from phototaxis_sensors.fmu.wiring import SUITES, Suite, bounds, connect, declared_unit
from phototaxis_sensors.model import Past, SensorModel
from phototaxis_sensors.scene import Scene

EPISODE, EPISODES = 50, 4
"""Ticks and episodes of a dry run; each episode is gone through twice."""


class Info(Struct, kw_only=True):
    """Options of `phototaxis fmu info`."""

    file: str
    """the FMU"""
    json: bool = False
    """print it as one JSON object"""


class Check(Struct, kw_only=True):
    """Options of `phototaxis fmu check`."""

    file: str
    """the FMU"""
    kind: Literal["light", "sonar", "any"] = "any"
    """what it is to be; any: whatever it fits"""
    fmu_map: list[str] = []
    """OUR=THEIRS: our input or output is the FMU's variable of another name (may be repeated)"""
    fmu_param: list[str] = []
    """NAME=VALUE: a parameter of the FMU (may be repeated)"""
    fmu_timeout: Annotated[float, Meta(gt=0)] = 5.0
    """seconds after which an FMU that does not answer is ended"""
    allow_compile: bool = False
    """compile an FMU that comes as C source alone: this runs its author's build"""
    json: bool = False
    """print the result as one JSON object"""


class Build(Struct, kw_only=True):
    """Options of `phototaxis fmu build`."""

    name: str
    """which example: light, lag, photodiode, sonar"""
    fmi: Literal[2, 3] = 3
    """version of FMI: 2 or 3"""
    output: str = ""
    """file to write (default: NAME.fmu)"""
    sources_only: bool = False
    """leave this machine's library out; whoever uses it compiles it"""


def main(argv: Sequence[str]) -> int:
    verbs = {"info": info, "check": check, "build": make}
    if not argv or argv[0] not in verbs:
        text = "usage: phototaxis fmu info FILE | check FILE | build NAME   (each has --help)"
        if argv and argv[0] not in ("-h", "--help"):
            raise UserError(f"no command 'fmu {argv[0]}'; there are: {', '.join(verbs)}")
        print(text)
        return 0
    return verbs[argv[0]](argv[1:])


def info(argv: Sequence[str]) -> int:
    """Variables, units, causality, platforms, and what maps onto what."""
    about = "Show what is in an FMU and how it would be connected, without running any of it."
    options = parse(Info, argv, "phototaxis fmu info", about, positional=["file"])
    found = describe(read(options.file))
    print(json.dumps(found) if options.json else _text(found))
    return 0


def describe(fmu: Fmu) -> dict[str, Any]:
    """An FMU as plain data."""
    description = fmu.description
    variables = []
    for one in description.modelVariables:
        low, high = bounds(one)
        variables.append(
            {
                "name": one.name,
                "causality": one.causality,
                "type": one.type,
                "shape": list(one.shape or ()),
                "unit": declared_unit(one),
                "start": one.start,
                "min": low if math.isfinite(low) else None,
                "max": high if math.isfinite(high) else None,
                "description": one.description,
            }
        )
    return {
        "file": str(fmu.file),
        "fmi": description.fmiVersion,
        "model": description.modelName,
        "description": description.description,
        "tool": description.generationTool,
        "platforms": fmu.platforms,
        "sources": fmu.sources,
        "runs_here": fmu.compiled,
        "needs_tool": bool(description.coSimulation and description.coSimulation.needsExecutionTool),
        "once_per_process": fmu.once,
        "variables": variables,
        "as": {kind: _connection(fmu, suite) for kind, suite in SUITES.items()},
    }


def _connection(fmu: Fmu, suite: Suite) -> dict[str, Any]:
    try:
        wiring = connect(fmu, suite, {}, {})
    except UserError as error:
        return {"fits": False, "why": str(error).removeprefix(f"{fmu.file}: ")}
    wires = [*wiring.inputs, *wiring.outputs]
    return {"fits": True, "wires": [[wire.port, wire.variable.name, wire.factor, wire.offset] for wire in wires]}


def _text(found: dict[str, Any]) -> str:
    here = "runs here" if found["runs_here"] else "does not run here as it is"
    has = ", ".join([*found["platforms"], *(["C sources"] if found["sources"] else [])]) or "nothing"
    needs = [
        *(["needs the tool that made it, or its language, at run time"] if found["needs_tool"] else []),
        *(["one instance a process"] if found["once_per_process"] else []),
    ]
    lines = [
        f"{found['file']}: {found['model']}, FMI {found['fmi']} co-simulation",
        *([found["description"]] if found["description"] else []),
        "; ".join([f"has {has}", here, *needs]),
        "",
    ]
    for one in found["variables"]:
        shape = "".join(f"[{extent}]" for extent in one["shape"])
        limits = [f"{name} {one[name]:g}" for name in ("min", "max") if one[name] is not None]
        start = [f"start {one['start']}"] if one["start"] is not None and not shape else []
        rest = ", ".join([*start, *limits])
        unit = one["unit"] or "–"
        row = one["causality"], one["name"] + shape, one["type"], unit, rest, one["description"] or ""
        lines.append("  {:11} {:16} {:8} {:6} {:24} {}".format(*row))
    lines.append("")
    for kind, how in found["as"].items():
        if not how["fits"]:
            lines.append(f"as a {kind} sensor: no; {how['why']}")
            continue
        wires = []
        for ours, theirs, factor, offset in how["wires"]:
            change = "" if (factor, offset) == (1, 0) else f" · {factor:g}" + (f" + {offset:g}" if offset else "")
            wires.append(f"{theirs} = {ours}{change}")
        lines.append(f"as a {kind} sensor: {', '.join(wires[:4])}{', …' if len(wires) > 4 else ''}")
    return "\n".join(line.rstrip() for line in lines)


def check(argv: Sequence[str]) -> int:
    """Validation, then a dry run."""
    about = "Validate an FMU and drive a robot about with it: does it load, step, reset and repeat itself?"
    options = parse(Check, argv, "phototaxis fmu check", about, positional=["file"])
    fmu = read(options.file)
    remarks = validate_fmu(options.file)
    for remark in remarks:
        print(f"{options.file}: not as the standard has it: {remark}", file=sys.stderr)
    kinds = [options.kind] if options.kind != "any" else [k for k in SUITES if _connection(fmu, SUITES[k])["fits"]]
    if not kinds and options.fmu_map:
        raise UserError(f"{options.file}: say what --fmu-map is for: --kind light or --kind sonar")
    if not kinds:
        connect(fmu, SUITES["light"], {}, {})
    results = []
    for kind in kinds:
        sensors = FmuSensors(_as(kind, options))
        try:
            results.append(dry_run(sensors, kind))
        finally:
            sensors.close()
        if not options.json:
            print("{kind}: {ticks} ticks in {episodes} episodes, readings {low:.3g} to {high:.3g}, "
                  "{microseconds:.0f} µs a tick; the same again after a reset".format(**results[-1]))  # fmt: skip
    if options.json:
        print(json.dumps({"file": options.file, "remarks": remarks, "runs": results}))
    return 0


def _as(kind: str, options: Check) -> FmuOptions:
    return FmuOptions(
        light_fmu=options.file if kind == "light" else "",
        sonar_fmu=options.file if kind == "sonar" else "",
        fmu_map=options.fmu_map,
        fmu_param=options.fmu_param,
        fmu_timeout=options.fmu_timeout,
        allow_compile=options.allow_compile,
    )


def dry_run(sensors: FmuSensors, kind: str) -> dict[str, Any]:
    """Drive about at random, each episode twice.

    Raises
    ------
    UserError
        when the FMU fails, or the same inputs give other readings after a reset.
    """
    arena = Arena("check", (10.0, 10.0), [Light((5.0, 5.0))])
    model: SensorModel = getattr(sensors(arena, Scene(arena)), kind)
    chance, readings, spent = random.Random(1), list[float](), 0.0  # noqa: S311
    for episode in range(EPISODES):
        ways = [(chance.uniform(1, 9), chance.uniform(1, 9), chance.uniform(-3, 3)) for _ in range(EPISODE)]
        twice = []
        for half in range(2):
            began = time.perf_counter()
            at = 2 * episode + half
            twice.append([list(model(Past(at * EPISODE + i, at, *way))) for i, way in enumerate(ways)])
            spent += time.perf_counter() - began
        if twice[0] != twice[1]:
            raise UserError("after a reset the same inputs give other readings: runs with this FMU cannot be repeated")
        readings += [value for one in twice[0] for value in one]
    ticks = 2 * EPISODE * EPISODES
    low, high = min(readings), max(readings)
    return {
        "kind": kind, "ticks": ticks, "episodes": 2 * EPISODES, "low": low, "high": high,
        "microseconds": spent / ticks * 1e6,
    }  # fmt: skip


def make(argv: Sequence[str]) -> int:
    """Build an example."""
    about = "Build a shipped example from its C source: " + ", ".join(EXAMPLES)
    options = parse(Build, argv, "phototaxis fmu build", about, positional=["name"])
    if options.name not in EXAMPLES:
        raise UserError(f"no example '{options.name}'; there are: {', '.join(EXAMPLES)}")
    file = Path(options.output or f"{options.name}.fmu")
    build(EXAMPLES[options.name], options.fmi, file, options.sources_only)
    print(f"{file}: {EXAMPLES[options.name].about}, FMI {options.fmi}.0")
    return 0
