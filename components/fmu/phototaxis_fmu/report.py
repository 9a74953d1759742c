"""Reports on an FMU: its variables and connections, and how it behaves as a sensor of a moving robot."""

import math
import random
import time
from typing import Any

from phototaxis.geometry.arena import Arena, Light
from phototaxis.runtime.errors import UserError
from phototaxis_sensors.model import PastMoment, SensorModel
from phototaxis_sensors.scene import Scene

from phototaxis_fmu.description import Fmu
from phototaxis_fmu.sensors import FmuSensors
from phototaxis_fmu.start import bounds
from phototaxis_fmu.wiring import SUITES, Suite, connect, declared_unit

EPISODE_TICKS, EPISODE_COUNT = 50, 4
"""Ticks of an episode, and number of episodes, in a dry run; each episode is run twice."""


def describe(fmu: Fmu) -> dict[str, Any]:
    """Return everything about an FMU as plain data."""
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
        "needs_tool": fmu.interface.needsExecutionTool,
        "once_per_process": fmu.once,
        "variables": variables,
        "as": {kind: connection(fmu, suite) for kind, suite in SUITES.items()},
    }


def connection(fmu: Fmu, suite: Suite) -> dict[str, Any]:
    """Return how an FMU would be connected as one kind of sensor, or why it does not fit."""
    try:
        wiring = connect(fmu, suite, {}, {})
    except UserError as error:
        return {"fits": False, "why": str(error).removeprefix(f"{fmu.file}: ")}
    wires = [*wiring.inputs, *wiring.outputs]
    return {"fits": True, "wires": [[wire.port, wire.variable.name, wire.factor, wire.offset] for wire in wires]}


def text(found: dict[str, Any]) -> str:
    """Format the result of `describe` for a person."""
    here = "runs here" if found["runs_here"] else "does not run here as it is"
    has = ", ".join([*found["platforms"], *(["C sources"] if found["sources"] else [])]) or "nothing"
    needs = [
        *(["needs the tool that made it, or its language, at run time"] if found["needs_tool"] else []),
        *(["only one instance per process"] if found["once_per_process"] else []),
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


def dry_run(sensors: FmuSensors, kind: str) -> dict[str, Any]:
    """Move a robot with the FMU at random, each episode twice, and return a summary of the readings.

    Raises
    ------
    UserError
        when the FMU fails, or the same inputs give different readings the second time.
    """
    arena = Arena("check", (10.0, 10.0), [Light((5.0, 5.0))])
    model: SensorModel = getattr(sensors(arena, Scene(arena)), kind)
    chance, readings, spent = random.Random(1), list[float](), 0.0  # noqa: S311 - a drive, no secret
    for episode in range(EPISODE_COUNT):
        ways = [(chance.uniform(1, 9), chance.uniform(1, 9), chance.uniform(-3, 3)) for _ in range(EPISODE_TICKS)]
        twice = []
        for half in range(2):
            began = time.perf_counter()
            at = 2 * episode + half
            twice.append([list(model(PastMoment(at * EPISODE_TICKS + i, at, *way))) for i, way in enumerate(ways)])
            spent += time.perf_counter() - began
        if twice[0] != twice[1]:
            line = f"after {sensors.begins} the same inputs give other readings: runs with this FMU cannot be repeated"
            raise UserError(line + (" (--fmu-fresh may help)" if sensors.begins == "a reset" else ""))
        readings += [value for one in twice[0] for value in one]
    ticks = 2 * EPISODE_TICKS * EPISODE_COUNT
    low, high = min(readings), max(readings)
    return {
        "kind": kind, "ticks": ticks, "episodes": 2 * EPISODE_COUNT, "low": low, "high": high,
        "microseconds": spent / ticks * 1e6, "begins": sensors.begins,
    }  # fmt: skip
