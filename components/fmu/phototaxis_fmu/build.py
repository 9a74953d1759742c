"""Builds FMUs: packs a model in C with its description, and compiles the library for this machine."""

import os
import shutil
import subprocess
import sys
import uuid
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from phototaxis.runtime.disk import check_writable, write_atomic
from phototaxis.runtime.errors import UserError

from phototaxis_fmu.examples import FOLDER, Example, Variable

Version = Literal[2, 3]
PLAIN_NAMES = [f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX" for version in (2, 3)]
"""Compiler flags that make the standard's headers leave out the function prefix that sources may define."""
UNITS = {"m": {"m": "1"}, "rad": {"rad": "1"}, "s": {"s": "1"}, "1": {}}


def build(example: Example, version: Version, file: Path, sources_only: bool = False) -> None:
    """Write the FMU of an example for FMI 2.0 or 3.0, with this machine's library unless `sources_only`.

    Raises
    ------
    UserError
        when the file cannot be written, or there is no C compiler.
    """
    check_writable(file, "--output")
    with TemporaryDirectory(prefix="phototaxis-fmu-") as folder:
        tree = Path(folder) / "fmu"
        sources = tree / "sources"
        sources.mkdir(parents=True)
        for name in (example.folder / f"{example.name}.c", FOLDER / f"fmi{version}.c", FOLDER / "model.h"):
            shutil.copy(name, sources)
        token = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, f'phototaxis/fmu/{example.name}/{version}')}}}"
        (sources / "names.h").write_text(_names(example))
        (sources / "variables.h").write_text(_variables(example, token))
        _write(tree / "modelDescription.xml", (_fmi2 if version == 2 else _fmi3)(example, token))
        if version == 3:
            _write(sources / "buildDescription.xml", _recipe(example))
        archive = Path(shutil.make_archive(str(Path(folder) / "packed"), "zip", tree))
        if not sources_only:
            compile_sources(archive)
        write_atomic(file, archive.read_bytes())


def compiled(file: Path) -> bytes:
    """Return the content of an FMU file, with the library for this machine compiled from its sources.

    Raises
    ------
    UserError
        as `compile_sources` does.
    """
    with TemporaryDirectory(prefix="phototaxis-fmu-") as folder:
        archive = Path(shutil.copyfile(file, Path(folder) / "compiled.fmu"))
        compile_sources(archive)
        return archive.read_bytes()


def compile_sources(archive: Path) -> None:
    """Compile the sources of an FMU file for this machine, and add the library to the file.

    Raises
    ------
    UserError
        when the C compiler is missing or rejects the sources.
    """
    beside = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])  # cmake is beside python
    flags = {name: " ".join([os.environ.get(name, ""), *PLAIN_NAMES]).strip() for name in ("CFLAGS", "CXXFLAGS")}
    command = [sys.executable, "-m", "fmpy", "compile", archive, "--generator", "Unix Makefiles"]
    environment = os.environ | flags | {"PATH": beside}
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False, env=environment)
    if done.returncode:
        lines = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        said = [line for line in lines if "error" in line.lower()] or lines[-1:] or ["no reason given"]
        raise UserError(f"the C sources do not compile: {said[0]} (needs gcc and make)")


def _names(example: Example) -> str:
    """Return names.h, which only the model includes: it names each variable; `m->v[0]` is the time."""
    lines = ['#include "model.h"', ""]
    for variable, reference in _references(example):
        place = f"m->v + {reference}" if variable.size > 1 else f"m->v[{reference}]"
        lines.append(f"#define {variable.name} ({place})")
    return "\n".join(lines) + "\n"


def _variables(example: Example, token: str) -> str:
    """Return variables.h, which the wrapper includes: token, start values and sizes of all variables."""
    starts, sizes = ["0"], ["1"]
    for variable, _ in _references(example):
        starts += [repr(variable.start or 0.0)] * variable.size
        sizes += [str(variable.size), *["0"] * (variable.size - 1)]
    lines = [f'#define TOKEN "{token}"', f"#define VARIABLES {len(starts)}"]
    lines += [f"#define {name} {{{', '.join(values)}}}" for name, values in (("STARTS", starts), ("SIZES", sizes))]
    return "\n".join(lines) + "\n"


def _references(example: Example) -> Iterator[tuple[Variable, int]]:
    reference = 1
    for variable in example.variables:
        yield variable, reference
        reference += variable.size


def _description(example: Example, version: str, **more: str) -> ET.Element:
    given = {"fmiVersion": version, "modelName": example.name, "description": example.about}
    more |= {"generationTool": "phototaxis", "variableNamingConvention": "structured"}
    return ET.Element("fmiModelDescription", given | more)


def _interface(example: Example, state: str) -> dict[str, str]:
    abilities = {"canHandleVariableCommunicationStepSize": "true", f"canGetAndSet{state}": "true"}
    return {"modelIdentifier": example.name} | abilities


def _units(root: ET.Element) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name, base in UNITS.items():
        ET.SubElement(ET.SubElement(definitions, "Unit", name=name), "BaseUnit", base)


def _attributes(variable: Variable) -> dict[str, str]:
    given = {"start": variable.start, "min": variable.low, "max": variable.high}
    found = {name: repr(value) for name, value in given.items() if value is not None}
    return found | ({"unit": variable.unit} if variable.unit else {})


def _fmi2(example: Example, token: str) -> ET.Element:
    """Return modelDescription.xml for FMI 2.0, in which an array becomes scalars NAME[1], NAME[2], …."""
    root = _description(example, "2.0", guid=token)
    interface = ET.SubElement(root, "CoSimulation", _interface(example, "FMUstate"))
    files = ET.SubElement(interface, "SourceFiles")
    for name in (f"{example.name}.c", "fmi2.c"):
        ET.SubElement(files, "File", name=name)
    _units(root)
    variables, outputs = ET.SubElement(root, "ModelVariables"), []
    for variable, reference in _references(example):
        for number in range(variable.size):
            name = f"{variable.name}[{number + 1}]" if variable.size > 1 else variable.name
            one = ET.SubElement(variables, "ScalarVariable", name=name, valueReference=str(reference + number))
            one.attrib |= {"causality": variable.causality, "description": variable.about}
            if variable.causality == "parameter":
                one.attrib |= {"variability": "tunable"}
            ET.SubElement(one, "Real", _attributes(variable))
            if variable.causality == "output":
                outputs.append(str(len(variables)))
    structure = ET.SubElement(root, "ModelStructure")
    for part in ("Outputs", "InitialUnknowns"):
        element = ET.SubElement(structure, part)
        for index in outputs:
            ET.SubElement(element, "Unknown", index=index)
    return root


def _fmi3(example: Example, token: str) -> ET.Element:
    root = _description(example, "3.0", instantiationToken=token)
    ET.SubElement(root, "CoSimulation", _interface(example, "FMUState"))
    _units(root)
    variables, structure = ET.SubElement(root, "ModelVariables"), ET.SubElement(root, "ModelStructure")
    ET.SubElement(
        variables, "Float64", name="time", valueReference="0", causality="independent", variability="continuous"
    )
    unknown: list[str] = []
    for variable, reference in _references(example):
        one = ET.SubElement(variables, "Float64", name=variable.name, valueReference=str(reference))
        one.attrib |= {"causality": variable.causality, "description": variable.about, **_attributes(variable)}
        if variable.causality == "parameter":
            one.attrib |= {"variability": "tunable"}
        if variable.size > 1:
            ET.SubElement(one, "Dimension", start=str(variable.size))
            if variable.start is not None:
                one.attrib["start"] = " ".join([repr(variable.start)] * variable.size)
        if variable.causality == "output":
            unknown.append(str(reference))
    for kind in ("Output", "InitialUnknown"):
        for reference in unknown:
            ET.SubElement(structure, kind, valueReference=reference)
    return root


def _recipe(example: Example) -> ET.Element:
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    files = ET.SubElement(ET.SubElement(root, "BuildConfiguration", modelIdentifier=example.name), "SourceFileSet")
    for name in (f"{example.name}.c", "fmi3.c"):
        ET.SubElement(files, "SourceFile", name=name)
    return root


def _write(file: Path, root: ET.Element) -> None:
    ET.indent(root)
    ET.ElementTree(root).write(file, encoding="UTF-8", xml_declaration=True)
