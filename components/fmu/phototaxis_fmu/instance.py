"""Runs one instance of an FMU inside the worker: begins episodes, steps it, and replaces it if a reset fails."""

import ctypes
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import groupby
from typing import Any, NamedTuple

import msgspec

from phototaxis_fmu.log import MARK, one_line

STATUS = ("OK", "a warning", "discard", "an error", "a fatal error", "pending")
WARNING, FATAL = 1, 4
TOLD = 2 * 1000
"""Most messages of the FMU's logger that the worker passes on; the parent shows fewer."""


class Ends(msgspec.Struct):
    """Consecutive inputs or outputs of an instance that have the same type."""

    kind: str
    """The FMI type, as in "Float64"."""
    references: list[int]
    """Value references; an array has one reference for several values."""
    values: int
    """Number of values."""


class Parameter(msgspec.Struct):
    """The start values of one variable."""

    kind: str
    reference: int
    values: list[int | float | bool | str]
    structural: bool = False
    """Whether it can change the sizes of other variables, and is set in configuration mode."""


class InstanceSetup(msgspec.Struct):
    """The first message from the parent to the worker: which FMU to load, and how to run it."""

    folder: str
    """Folder of the unpacked FMU."""
    version: int
    identifier: str
    token: str
    instances: int
    inputs: list[Ends]
    outputs: list[Ends]
    parameters: list[Parameter]
    step: float
    """Length of one step, s."""
    times: int
    """Steps in a control period."""
    fresh: bool
    """Whether each episode gets a fresh instance, without an attempt to reset the last one."""
    once: bool
    """Whether a process can create only one instance in its whole life."""
    logging: bool
    """Whether the FMU's logging is on."""
    least: int
    """Lowest status of log messages that the worker passes on."""


class Broken(Exception):
    """The FMU cannot be loaded or go on; the text says why."""


class Voice:
    """Passes the FMU's log messages on to the parent, and keeps the worst since the last request as the reason."""

    def __init__(self, least: int):
        self._least, self._left, self._worst, self.reason = least, TOLD, 0, ""

    def forget(self) -> None:
        """Drop the reason, since a new request begins."""
        self._worst, self.reason = 0, ""

    def hear(self, status: int, message: bytes | None) -> None:
        """Take a log message; the FMU calls this."""
        if status and status >= self._worst:
            self._worst, self.reason = status, one_line(message or b"")
        if status >= self._least and self._left:
            self._left -= 1
            with suppress(OSError):
                os.write(2, MARK + b"%d" % min(max(status, 0), 5) + one_line(message or b"").encode() + b"\n")


class Part(NamedTuple):
    """Consecutive inputs or outputs of one type, and the FMI function that sets or gets them."""

    name: str
    call: Callable[..., int]
    arguments: tuple[Any, ...]
    """Arguments after the instance: value references, their number, values, and for FMI 3 the number of values."""
    values: Any
    """The values in the FMU's own type."""
    doubles: Any
    """The same values in the buffer of doubles; None if `values` are in that buffer themselves."""


class Instance:
    """One instance of the FMU; its inputs and outputs are slices of buffers that all instances share.

    Parameters
    ----------
    setup : the FMU and how to run it.
    number : number of the instance, from 0.
    inputs, outputs : the shared buffers of doubles, and the offset of the instance's slice in bytes.
    voice : receives the FMU's log messages.
    """

    def __init__(
        self,
        setup: InstanceSetup,
        number: int,
        inputs: tuple[bytearray, int],
        outputs: tuple[bytearray, int],
        voice: Voice,
    ):
        self._setup, self._voice, self._used, self._time = setup, voice, False, 0.0
        self._fmu = self._load(number)
        self._callbacks: Any = None
        self._instantiate()
        self._inputs = self._parts("Set", setup.inputs, *inputs)
        self._outputs = self._parts("Get", setup.outputs, *outputs)

    def begin(self) -> str:
        """Begin an episode at time 0, with the inputs in the buffer.

        Returns why the instance could not be reset and was replaced by a fresh one; "" if it was reset.
        """
        from fmpy.fmi1 import FMICallException

        why = ""
        if self._used and not self._setup.fresh:
            try:
                self._fmu.reset()
                self._initialise()
            except FMICallException as error:
                if self._setup.once or error.status == FATAL:
                    raise
                why = explain(error, self._voice)
                self._setup.fresh = True
            else:
                return ""
        elif self._used:
            with suppress(FMICallException):
                self._fmu.terminate()
        if self._used:
            self._free()
            self._instantiate()
        self._used = True
        self._initialise()
        return why

    def step(self, count: int) -> None:
        """Step by `count` control periods with the inputs in the buffer, and put the outputs into theirs."""
        self._feed()
        fmu, step = self._fmu, self._setup.step
        for _ in range(count * self._setup.times):
            found = fmu.doStep(self._time, step)
            if found is not None and (found[1] or found[2]):
                raise Broken(f"{'terminated' if found[1] else 'returned early'} at {self._time:g} s")
            self._time += step
        for name, call, arguments, values, doubles in self._outputs:
            if (status := call(fmu.component, *arguments)) > WARNING:
                raise self._refused(name, status)
            if doubles is not None:
                doubles[:] = values[:]

    def end(self) -> None:
        """Terminate and free the instance."""
        self._fmu.terminate()
        self._free()

    def _initialise(self) -> None:
        fmu, setup = self._fmu, self._setup
        self._time = 0.0
        structural = [one for one in setup.parameters if one.structural]
        if structural:
            fmu.enterConfigurationMode()
            self._set(structural)
            fmu.exitConfigurationMode()
        self._set([one for one in setup.parameters if not one.structural])
        if setup.version == 2:
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
        else:
            fmu.enterInitializationMode(startTime=0.0)
        self._feed()
        fmu.exitInitializationMode()

    def _set(self, parameters: Sequence[Parameter]) -> None:
        enumeration = "Int64" if self._setup.version == 3 else "Integer"
        for one in parameters:
            kind = enumeration if one.kind == "Enumeration" else one.kind
            getattr(self._fmu, f"set{kind}")([one.reference], one.values)

    def _feed(self) -> None:
        for name, call, arguments, values, doubles in self._inputs:
            if doubles is not None:
                values[:] = doubles[:]
            if (status := call(self._fmu.component, *arguments)) > WARNING:
                raise self._refused(name, status)

    def _free(self) -> None:
        """Free the instance but keep the library, because loading a library repeatedly leaks memory or crashes."""
        component, self._fmu.component = self._fmu.component, None
        getattr(self._fmu, f"fmi{self._setup.version}FreeInstance")(component)

    @staticmethod
    def _refused(name: str, status: int) -> Exception:
        from fmpy.fmi1 import FMICallException

        return FMICallException(name, status)

    def _parts(self, verb: str, ends: Sequence[Ends], buffer: bytearray, at: int) -> list[Part]:
        found = []
        for end in ends:
            doubles = (ctypes.c_double * end.values).from_buffer(buffer, at)
            at += ctypes.sizeof(doubles)
            single = end.kind == "Float32"
            values = (ctypes.c_float * end.values)() if single else doubles
            references = (ctypes.c_uint * len(end.references))(*end.references)
            more = () if self._setup.version == 2 else (end.values,)
            name = f"fmi{self._setup.version}{verb}{end.kind}"
            call = getattr(self._fmu.dll, name)  # called directly, with types from fmpy, as fmpy's wrappers are slower
            arguments = references, len(references), values, *more
            found.append(Part(name, call, arguments, values, doubles if single else None))
        return found

    def _load(self, number: int) -> Any:
        from phototaxis_fmu.library import FMU2Library, FMU3Library

        setup = self._setup
        try:
            return (FMU2Library if setup.version == 2 else FMU3Library)(
                guid=setup.token, unzipDirectory=setup.folder, modelIdentifier=setup.identifier,
                instanceName=f"{setup.identifier}-{number}",
            )  # fmt: skip
        except AttributeError as error:
            raise Broken(f"its library lacks a function: {str(error).split(': ')[-1]}") from None
        except Exception as error:  # fmpy raises plain Exceptions
            raise Broken(f"its library cannot be loaded: {str(error).split('. ', 1)[-1]}") from None

    def _instantiate(self) -> None:
        from fmpy.fmi1 import FMICallException

        try:
            if self._setup.version == 2:
                self._callbacks = self._callbacks or _callbacks2(self._voice)
                self._fmu.instantiate(callbacks=self._callbacks, loggingOn=self._setup.logging)
            else:
                self._fmu.instantiate(
                    logMessage=lambda _, status, __, message: self._voice.hear(status, message),
                    loggingOn=self._setup.logging,
                )
        except FMICallException:
            raise
        except Exception:  # fmpy raises plain Exceptions
            if self._setup.logging or self._voice.reason:
                raise Broken("cannot be instantiated") from None
            self._setup.logging = True  # try once more with logging, to learn why
            self._instantiate()
            return
        if self._setup.logging:
            with suppress(FMICallException):
                self._fmu.setDebugLogging(True, [])  # all categories; a list of them would drop messages without one


def _callbacks2(voice: Voice) -> Any:
    """Return the functions that an FMI 2 FMU may call; the logger gets messages that are already formatted."""
    from fmpy import calloc, fmi2, free

    calls = fmi2.fmi2CallbackFunctions()
    calls.logger = fmi2.fmi2CallbackLoggerTYPE(lambda _, __, status, ___, message: voice.hear(status, message))
    calls.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    calls.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    fmi2.addLoggerProxy(ctypes.byref(calls))
    return calls


def explain(error: Exception, voice: Voice) -> str:
    """Describe an error in words, with the reason that the FMU logged."""
    status = getattr(error, "status", None)
    text = str(error)
    if status is not None:
        text = f"{getattr(error, 'function', 'a call')} returned {STATUS[status] if status < 6 else status}"
    elif not isinstance(error, Broken):
        text = f"{type(error).__name__}: {text}"
    return f"{text} ({voice.reason})" if voice.reason else text


def ends(variables: Sequence[tuple[str, int, int]]) -> list[Ends]:
    """Group consecutive variables (type, value reference, number of values) of the same type."""
    found = []
    for kind, run in groupby(variables, key=lambda one: one[0]):
        members = list(run)
        found.append(Ends(kind, [one[1] for one in members], sum(one[2] for one in members)))
    return found
