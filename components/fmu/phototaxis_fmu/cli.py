"""`phototaxis fmu`: shows what is in an FMU, tests it as a sensor, and builds the shipped examples."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.options import parse
from phototaxis.runtime.phrases import known


class Info(Struct, kw_only=True):
    """Options of `phototaxis fmu info`."""

    file: str
    """the FMU"""
    allow_invalid: bool = False
    """show an FMU whose model description does not validate against the standard's schema"""
    json: bool = False
    """print the result as one JSON object"""


class Check(Struct, kw_only=True):
    """Options of `phototaxis fmu check`."""

    file: str
    """the FMU"""
    kind: Literal["light", "sonar", "any"] = "any"
    """sensor to test the FMU as; any: each one that it fits"""
    fmu_map: list[str] = []
    """OUR=THEIRS: connect our input or output OUR to the FMU's variable THEIRS (may be repeated)"""
    fmu_param: list[str] = []
    """NAME=VALUE: start value of a parameter of the FMU, or of an input that is not connected; VALUE,VALUE,… for an
    array (may be repeated)"""
    fmu_step: Annotated[float, Meta(ge=0)] = 0.0
    """step size of the FMU, s; half a second must be a whole number of steps; 0: as the FMU's description asks"""
    fmu_fresh: bool = False
    """begin each episode with a fresh instance of the FMU, in place of a reset"""
    fmu_log: bool = False
    """show all output of the FMU, not only its first lines"""
    fmu_timeout: Annotated[float, Meta(gt=0)] = 5.0
    """seconds after which an FMU that does not answer is killed"""
    allow_compile: bool = False
    """compile an FMU that contains only C sources; this runs its author's build"""
    allow_invalid: bool = False
    """use an FMU whose model description does not validate against the standard's schema"""
    json: bool = False
    """print the result as one JSON object"""


class Build(Struct, kw_only=True):
    """Options of `phototaxis fmu build`."""

    name: str
    """name of the example: light, lag, photodiode, sonar"""
    fmi: Literal[2, 3] = 3
    """version of FMI: 2 or 3"""
    output: str = ""
    """file to write (default: NAME.fmu)"""
    sources_only: bool = False
    """leave out this machine's library; the user of the FMU compiles it"""


def main(argv: Sequence[str]) -> int:
    verbs = {"info": info, "check": check, "build": make}
    if not argv or argv[0] not in verbs:
        text = "usage: phototaxis fmu info FILE | check FILE | build NAME   (each has --help)"
        if argv and argv[0] not in ("-h", "--help"):
            raise UserError(f"no command 'fmu {argv[0]}'; {known(argv[0], verbs)}")
        print(text)
        return 0
    return verbs[argv[0]](argv[1:])


def info(argv: Sequence[str]) -> int:
    """Print variables, units, causality and platforms of an FMU, and which variables connect to our quantities."""
    about = "Show what is in an FMU and how it would be connected, without running its code."
    options = parse(Info, argv, "phototaxis fmu info", about, positional=["file"])
    from phototaxis_fmu.description import read
    from phototaxis_fmu.report import describe, text

    found = describe(read(options.file, options.allow_invalid))
    print(json.dumps(found) if options.json else text(found))
    return 0


def check(argv: Sequence[str]) -> int:
    """Validate an FMU, then run it as a sensor with its logging on."""
    about = "Validate an FMU and drive a robot with it, to test that it loads, steps, resets and repeats its readings."
    options = parse(Check, argv, "phototaxis fmu check", about, positional=["file"])
    from fmpy.validation import validate_fmu

    from phototaxis_fmu.description import read
    from phototaxis_fmu.report import connection, dry_run
    from phototaxis_fmu.sensors import FmuSensors
    from phototaxis_fmu.wiring import SUITES, connect

    fmu = read(options.file, options.allow_invalid)
    remarks = validate_fmu(options.file)
    for remark in remarks:
        print(f"{options.file}: does not follow the standard: {remark}", file=sys.stderr)
    kinds = [options.kind] if options.kind != "any" else [k for k in SUITES if connection(fmu, SUITES[k])["fits"]]
    if not kinds and options.fmu_map:
        raise UserError(f"{options.file}: say what --fmu-map is for: --kind light or --kind sonar")
    if not kinds:
        connect(fmu, SUITES["light"], {}, {})
    results = []
    for kind in kinds:
        sensors = FmuSensors(_as(kind, options), logging=True)
        try:
            results.append(dry_run(sensors, kind))
        finally:
            sensors.close()
        if not options.json:
            print("{kind}: {ticks} ticks in {episodes} episodes, readings {low:.3g} to {high:.3g}, "
                  "{microseconds:.0f} µs a tick; repeated exactly after {begins}".format(**results[-1]))  # fmt: skip
    if options.json:
        print(json.dumps({"file": options.file, "remarks": remarks, "runs": results}))
    return 0


def _as(kind: str, options: Check) -> FmuOptions:
    return FmuOptions(
        light_fmu=options.file if kind == "light" else "",
        sonar_fmu=options.file if kind == "sonar" else "",
        fmu_map=options.fmu_map,
        fmu_param=options.fmu_param,
        fmu_step=options.fmu_step,
        fmu_fresh=options.fmu_fresh,
        fmu_log=options.fmu_log,
        fmu_timeout=options.fmu_timeout,
        allow_compile=options.allow_compile,
        allow_invalid=options.allow_invalid,
    )


def make(argv: Sequence[str]) -> int:
    """Build an example."""
    about = "Build a shipped example from its C source: light, lag, photodiode, sonar."
    options = parse(Build, argv, "phototaxis fmu build", about, positional=["name"])
    from phototaxis_fmu.build import build
    from phototaxis_fmu.examples import EXAMPLES

    if options.name not in EXAMPLES:
        raise UserError(f"no example '{options.name}'; {known(options.name, EXAMPLES)}")
    file = Path(options.output or f"{options.name}.fmu")
    build(EXAMPLES[options.name], options.fmi, file, options.sources_only)
    print(f"{file}: {EXAMPLES[options.name].about}, FMI {options.fmi}.0")
    return 0
