"""Reads and checks an FMU's description before any of its code runs."""

import stat
import sys
import zipfile
import zlib
from pathlib import Path
from typing import NamedTuple

import fmpy
from fmpy.model_description import (
    CoSimulation,
    ModelDescription,
    ModelVariable,
    ValidationError,
    read_model_description,
)
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue] - it has no stubs
from phototaxis.runtime.errors import UserError

MAX_UNPACKED_BYTES = 2_000_000_000
"""The largest size of an FMU when unpacked, bytes."""
UNPACKING_ERRORS = (zipfile.BadZipFile, zlib.error, RuntimeError, OSError)
"""Errors that a damaged, encrypted or unusual archive, or a full disk, raises."""


class Fmu(NamedTuple):
    """An FMU file and its description."""

    file: Path
    version: int
    """2 or 3."""
    description: ModelDescription
    interface: CoSimulation
    library: str
    """Path of this machine's library inside the archive."""
    platforms: list[str]
    """Platforms for which the archive has a library."""
    sources: bool
    """Whether the archive has C sources."""
    compiled: bool
    """Whether the archive has a library for this machine."""

    @property
    def name(self) -> str:
        return self.file.name

    @property
    def once(self) -> bool:
        """Whether a process can have only one instance of the FMU."""
        return self.interface.canBeInstantiatedOnlyOncePerProcess

    def variable(self, name: str) -> ModelVariable | None:
        """Return the variable of that name, or None."""
        return next((one for one in self.description.modelVariables if one.name == name), None)

    def listed(self, *causalities: str) -> str:
        """Return the names of the first variables of some causalities, for a message."""
        names = [one.name for one in self.description.modelVariables if one.causality in causalities]
        return ", ".join([*names[:8], *(["…"] if len(names) > 8 else [])]) or "none"


def read(path: str, allow_invalid: bool = False) -> Fmu:
    """Read an FMU's description without running or unpacking anything.

    With `allow_invalid`, a description that does not follow the standard's schema is used too, with a warning.

    Raises
    ------
    UserError
        when the FMU cannot be used; the text is one line that says why.
    """
    file = Path(path)
    try:
        with zipfile.ZipFile(file) as archive:
            members = archive.namelist()
            size = sum(one.file_size for one in archive.infolist())
            _well_packed(path, archive)
            try:
                version = _version(path, archive)
            except UNPACKING_ERRORS as error:
                raise UserError(f"{path}: cannot be unpacked: {error}") from None
    except FileNotFoundError:
        raise UserError(f"{path}: there is no such file") from None
    except (zipfile.BadZipFile, UnicodeError, IsADirectoryError):
        raise UserError(f"{path}: not an FMU: it is not a zip archive") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None
    if size > MAX_UNPACKED_BYTES:
        raise UserError(
            f"{path}: {size / 1e9:.1f} GB when unpacked; at most {MAX_UNPACKED_BYTES / 1e9:g} GB are allowed"
        )
    description = _describe(path, allow_invalid)
    interface = description.coSimulation
    if interface is None:
        others = {"Model Exchange": description.modelExchange, "Scheduled Execution": description.scheduledExecution}
        made = " and ".join(name for name, other in others.items() if other is not None) or "no kind of simulation"
        raise UserError(f"{path}: supports only {made}; it must support Co-Simulation")
    place = fmpy.platform if version == 2 else fmpy.platform_tuple
    library = f"binaries/{place}/{interface.modelIdentifier}{fmpy.sharedLibraryExtension}"
    parts = [member.split("/") for member in members]
    platforms = sorted({part[1] for part in parts if part[0] == "binaries" and len(part) > 2 and part[2]})
    sources = any(part[0] == "sources" and part[-1].endswith((".c", ".cpp")) for part in parts)
    return Fmu(file, version, description, interface, library, platforms, sources, library in members)


def _well_packed(path: str, archive: zipfile.ZipFile) -> None:
    members = archive.infolist()
    for one in members:
        if "\\" in one.orig_filename:
            raise UserError(
                f"{path}: wrongly packed: {one.orig_filename} has backslashes; paths in an FMU must have slashes"
            )
        if stat.S_ISLNK(one.external_attr >> 16):
            raise UserError(f"{path}: wrongly packed: {one.filename} is a symbolic link; pack the file itself")
    names = [one.filename for one in members]
    if "modelDescription.xml" not in names:
        deeper = next((name for name in names if name.lower().split("/")[-1] == "modeldescription.xml"), "")
        there = f"; {deeper} has the wrong place or name" if deeper else ""
        raise UserError(f"{path}: not an FMU: it has no modelDescription.xml{there}")


def _version(path: str, archive: zipfile.ZipFile) -> int:
    try:
        root = etree.fromstring(archive.read("modelDescription.xml"), etree.XMLParser(resolve_entities=False))
        said = root.get("fmiVersion") or "none"
    except etree.XMLSyntaxError as error:
        raise UserError(f"{path}: its modelDescription.xml is not XML: {error.msg}") from None
    if said != "2.0" and not said.startswith("3."):
        raise UserError(f"{path}: its FMI version is {said}; it must be 2.0 or 3.0")
    return int(said[0])


def _describe(path: str, allow_invalid: bool) -> ModelDescription:
    try:
        try:
            return read_model_description(path)
        except ValidationError as error:
            problem, more = error.problems[0], len(error.problems) - 1
            line = f"{path}: its modelDescription.xml is not valid: {problem}{f' (and {more} more)' if more else ''}"
            if not allow_invalid:
                raise UserError(f"{line}; to use it anyway, add --allow-invalid") from None
            print(f"sensors: {line}; it is used anyway", file=sys.stderr, flush=True)
            return _sound(read_model_description(path, validate=False))
    except UserError:
        raise
    except Exception as error:  # fmpy raises plain Exceptions
        raise UserError(f"{path}: its modelDescription.xml cannot be used: {' '.join(str(error).split())}") from None


def _sound(description: ModelDescription) -> ModelDescription:
    """Return an unvalidated description; ValueError when one of the fields that we use as numbers is not a number."""
    experiment, interface = description.defaultExperiment, description.coSimulation
    numbers = [experiment.stepSize] if experiment is not None else []
    numbers += [interface.fixedInternalStepSize] if interface is not None else []
    for one in (*description.modelVariables, *description.typeDefinitions):
        numbers += [one.min, one.max]
    for number in numbers:
        float(number or 0)
    return description


def require_library(fmu: Fmu, allow_compile: bool) -> None:
    """Raise UserError unless this machine can run the FMU, or may compile it (`allow_compile`)."""
    if fmu.compiled:
        return
    if fmu.sources and allow_compile:
        if not fmu.description.buildConfigurations:
            raise UserError(f"{fmu.file}: has C sources, but does not say which of them to compile")
        return
    if fmu.sources and not fmu.platforms:
        raise UserError(f"{fmu.file}: has only C sources; add --allow-compile to build it here")
    here = fmu.library.split("/")[1]
    others = f"only for {', '.join(fmu.platforms)}" if fmu.platforms else "no other library and no C sources"
    compile_it = "; it has C sources: add --allow-compile to build it here" if fmu.sources else ""
    raise UserError(f"{fmu.file}: has no library {fmu.library} for this machine ({here}), {others}{compile_it}")
