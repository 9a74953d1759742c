"""One instance of an FMU as the worker uses it: begun, stepped, begun anew, replaced by a fresh one."""

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
"""Most messages of the FMU's logger that are passed on; no more would be shown."""


class Ends(msgspec.Struct):
    """The variables of one type among an instance's inputs or outputs, in their order."""

    kind: str
    references: list[int]
    """Value references; with arrays they are fewer than the values."""
    values: int


class Parameter(msgspec.Struct):
    """Start values of one variable."""

    kind: str
    reference: int
    values: list[int | float | bool | str]
    structural: bool = False
    """It may change the sizes of other variables: set in configuration mode."""


class InstanceSetup(msgspec.Struct):
    """What the parent tells the worker first."""

    folder: str
    """Of the unpacked FMU."""
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
    """Each episode gets a fresh instance, without trying to reset the last one."""
    once: bool
    """A process can have one instance, and no second one after it."""
    logging: bool
    """The FMU's logging is on."""
    least: int
    """Status from which on the FMU's messages are passed on."""


class Broken(Exception):
    """The FMU refuses to go on; the text says why."""


class Voice:
    """What the FMU logs: all of it goes to the parent, and the worst since the last request is kept as the reason."""

    def __init__(self, least: int):
        self._least, self._left, self._worst, self.reason = least, TOLD, 0, ""

    def forget(self) -> None:
        """A new request begins."""
        self._worst, self.reason = 0, ""

    def hear(self, status: int, message: bytes | None) -> None:
        """Called by the FMU."""
        if status and status >= self._worst:
            self._worst, self.reason = status, one_line(message or b"")
        if status >= self._least and self._left:
            self._left -= 1
            with suppress(OSError):
                os.write(2, MARK + b"%d" % min(max(status, 0), 5) + one_line(message or b"").encode() + b"\n")


class Part(NamedTuple):
    """A run of inputs or outputs of one type, and the call that sets or gets them."""

    name: str
    call: Callable[..., int]
    arguments: tuple[Any, ...]
    """After the instance: value references, their number, values, and for FMI 3 the number of values."""
    values: Any
    doubles: Any
    """None where `values` are the doubles themselves."""


class Instance:
    """One instance of the FMU, whose inputs and outputs are parts of the buffers.

    Parameters
    ----------
    setup : what is run.
    number : of the instance.
    inputs, outputs : buffers of doubles, and where in them the instance's own begin (bytes).
    voice : hears what the FMU logs.
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
        """Time 0, with the inputs that are there.

        Returns why the instance could not be reset, so that a fresh one serves; "" where it could.
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
        """So many control periods on, with the inputs that are there; then the outputs are."""
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
        """Terminate and free it."""
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
        """Free the instance and keep the library: to load it again and again leaks, or crashes."""
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
            call = getattr(self._fmu.dll, name)  # whose types fmpy has declared; its own way to call takes longer
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
        except Exception as error:  # fmpy raises bare ones
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
        except Exception:  # fmpy raises bare ones
            if self._setup.logging or self._voice.reason:
                raise Broken("cannot be instantiated") from None
            self._setup.logging = True  # once more, to hear why
            self._instantiate()
            return
        if self._setup.logging:
            with suppress(FMICallException):
                self._fmu.setDebugLogging(True, [])  # of every category; to name them would leave out what has none


def _callbacks2(voice: Voice) -> Any:
    """The functions that an FMU of FMI 2 may call; its messages come formatted, as printf does it."""
    from fmpy import calloc, fmi2, free

    calls = fmi2.fmi2CallbackFunctions()
    calls.logger = fmi2.fmi2CallbackLoggerTYPE(lambda _, __, status, ___, message: voice.hear(status, message))
    calls.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    calls.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    fmi2.addLoggerProxy(ctypes.byref(calls))
    return calls


def explain(error: Exception, voice: Voice) -> str:
    """An error in words, with what the FMU said of it."""
    status = getattr(error, "status", None)
    text = str(error)
    if status is not None:
        text = f"{getattr(error, 'function', 'a call')} returned {STATUS[status] if status < 6 else status}"
    elif not isinstance(error, Broken):
        text = f"{type(error).__name__}: {text}"
    return f"{text} ({voice.reason})" if voice.reason else text


def ends(variables: Sequence[tuple[str, int, int]]) -> list[Ends]:
    """The variables (type, value reference, number of values) of an instance as runs of one type."""
    found = []
    for kind, run in groupby(variables, key=lambda one: one[0]):
        members = list(run)
        found.append(Ends(kind, [one[1] for one in members], sum(one[2] for one in members)))
    return found
