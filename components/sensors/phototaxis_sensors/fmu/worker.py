"""The process that foreign code runs in: it loads one FMU and steps its instances for its parent.

Requests come on standard input, answers go to what was standard output; the FMU's own output goes to
standard error. The first request is a `Setup` in JSON, after its length; each later one a head (`HEAD`: what to do, how
many steps) and the inputs of all instances, as doubles. An answer is a head (0 and 0, or `FAILED` and the
length of a text) and the outputs, or the text.
"""

import ctypes
import os
import shutil
import struct
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Any

import msgspec

HEAD = struct.Struct("<qq")
LENGTH = struct.Struct("<q")
BEGIN, STEP, FAILED = 1, 2, 1
STATUS = ("OK", "a warning", "discard", "an error", "a fatal error", "pending")


class Setup(msgspec.Struct):
    """What the parent tells first."""

    folder: str
    """Of the unpacked FMU; the worker removes it in the end."""
    version: int
    identifier: str
    token: str
    instances: int
    inputs: list[int]
    """Value references of one instance; with arrays they are fewer than the values."""
    values_in: int
    outputs: list[int]
    values_out: int
    parameters: list[tuple[str, int, Any]]
    """Type, value reference and value."""
    period: float
    """Length of a step, s."""


class Broken(Exception):
    """The FMU refuses to go on; the text says why."""


class Instance:
    """One instance of the FMU, whose inputs and outputs are parts of the buffers."""

    def __init__(self, setup: Setup, number: int, inputs: bytearray, outputs: bytearray, said: "deque[str]"):
        self._setup, self._said, self._fresh = setup, said, True
        kind = ctypes.c_double * setup.values_in
        self._in = kind.from_buffer(inputs, HEAD.size + number * ctypes.sizeof(kind))
        kind = ctypes.c_double * setup.values_out
        self._out = kind.from_buffer(outputs, HEAD.size + number * ctypes.sizeof(kind))
        self._in_refs = (ctypes.c_uint * len(setup.inputs))(*setup.inputs)
        self._out_refs = (ctypes.c_uint * len(setup.outputs))(*setup.outputs)
        self._fmu = self._load(number)
        self._instantiate()
        if setup.version == 2:
            self._set, self._get = self._fmu.fmi2SetReal, self._fmu.fmi2GetReal
            self._in_size, self._out_size = (), ()
        else:
            self._set, self._get = self._fmu.fmi3SetFloat64, self._fmu.fmi3GetFloat64
            self._in_size, self._out_size = (setup.values_in,), (setup.values_out,)
        self._time = 0.0

    def begin(self) -> None:
        """Time 0, with the inputs that are there."""
        fmu, setup = self._fmu, self._setup
        if not self._fresh:
            fmu.reset()
        self._fresh, self._time = False, 0.0
        for kind, reference, value in setup.parameters:
            kind = "Int64" if kind == "Enumeration" and setup.version == 3 else kind
            kind = "Integer" if kind == "Enumeration" else kind
            getattr(fmu, f"set{kind}")([reference], [value])
        if setup.version == 2:
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
        else:
            fmu.enterInitializationMode(startTime=0.0)
        self._feed()
        fmu.exitInitializationMode()

    def step(self, count: int) -> None:
        """So many periods on, with the inputs that are there; then the outputs are."""
        self._feed()
        for _ in range(count):
            found = self._fmu.doStep(self._time, self._setup.period)
            if found is not None and (found[1] or found[2]):
                raise Broken(f"{'terminated' if found[1] else 'returned early'} at {self._time:g} s")
            self._time += self._setup.period
        self._get(self._fmu.component, self._out_refs, len(self._out_refs), self._out, *self._out_size)

    def end(self) -> None:
        self._fmu.terminate()
        self._fmu.freeInstance()

    def _feed(self) -> None:
        self._set(self._fmu.component, self._in_refs, len(self._in_refs), self._in, *self._in_size)

    def _load(self, number: int) -> Any:
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        setup = self._setup
        try:
            return (FMU2Slave if setup.version == 2 else FMU3Slave)(
                guid=setup.token, unzipDirectory=setup.folder, modelIdentifier=setup.identifier,
                instanceName=f"{setup.identifier}-{number}",
            )  # fmt: skip
        except AttributeError as error:
            raise Broken(f"its library lacks a function: {str(error).split(': ')[-1]}") from None
        except Exception as error:  # fmpy raises bare ones
            raise Broken(f"its library cannot be loaded: {str(error).split('. ', 1)[-1]}") from None

    def _instantiate(self) -> None:
        from fmpy import calloc, fmi2, free

        def heard2(_: Any, __: Any, status: int, ___: Any, message: bytes) -> None:
            self._hear(status, message)

        def heard3(_: Any, status: int, __: Any, message: bytes) -> None:
            self._hear(status, message)

        try:
            if self._setup.version == 3:
                self._fmu.instantiate(logMessage=heard3)
                return
            calls = fmi2.fmi2CallbackFunctions()
            calls.logger = fmi2.fmi2CallbackLoggerTYPE(heard2)
            calls.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
            calls.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
            fmi2.addLoggerProxy(ctypes.byref(calls))
            self._fmu.instantiate(callbacks=calls)
        except Exception as error:
            from fmpy.fmi1 import FMICallException

            if isinstance(error, FMICallException):
                raise
            raise Broken("cannot be instantiated") from None

    def _hear(self, status: int, message: bytes) -> None:
        if status:
            self._said.append(message.decode(errors="replace").strip())


class Worker:
    """All instances, and the buffers that they share."""

    def __init__(self, setup: Setup, said: "deque[str]"):
        self.inputs = bytearray(HEAD.size + 8 * setup.values_in * setup.instances)
        self.outputs = bytearray(HEAD.size + 8 * setup.values_out * setup.instances)
        self.instances = [Instance(setup, number, self.inputs, self.outputs, said) for number in range(setup.instances)]

    def answer(self) -> None:
        """Do what the head of the inputs says."""
        order, count = HEAD.unpack_from(self.inputs)
        for one in self.instances:
            if order == BEGIN:
                one.begin()
            else:
                one.step(count)


def why(error: Exception, said: "deque[str]") -> str:
    """An error in words, with what the FMU said last."""
    status = getattr(error, "status", None)
    text = str(error)
    if status is not None:
        text = f"{getattr(error, 'function', 'a call')} returned {STATUS[status] if status < 6 else status}"
    elif not isinstance(error, Broken):
        text = f"{type(error).__name__}: {text}"
    return f"{text} ({said[0]})" if said else text


def read(source: int, into: memoryview) -> bool:
    """Fill a buffer; False at the end of the stream."""
    while into:
        got = os.readv(source, [into])
        if not got:
            return False
        into = into[got:]
    return True


def serve(source: int, answers: int) -> None:
    """Answer until the parent closes the stream."""
    length = bytearray(LENGTH.size)
    if not read(source, memoryview(length)):
        return
    text = bytearray(LENGTH.unpack(length)[0])
    read(source, memoryview(text))
    setup = msgspec.json.decode(text, type=Setup)
    threading.Thread(target=_outlive, args=(os.getppid(), setup.folder), daemon=True).start()
    said: deque[str] = deque(maxlen=1)
    try:
        worker = Worker(setup, said)
        os.write(answers, HEAD.pack(0, 0))
        while read(source, memoryview(worker.inputs)):
            worker.answer()
            os.write(answers, worker.outputs)
        for one in worker.instances:
            one.end()
    except Exception as error:
        words = why(error, said).encode()
        with suppress(BrokenPipeError):
            os.write(answers, HEAD.pack(FAILED, len(words)) + words)
    shutil.rmtree(setup.folder, ignore_errors=True)  # the parent, if it is still there, finds nothing left to do


def _outlive(parent: int, folder: str) -> None:
    """End with the parent even in the middle of an endless loop, and leave nothing."""
    while os.getppid() == parent:
        time.sleep(0.5)  # portable, which prctl and kqueue are not
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def main() -> None:
    source, answers = os.dup(0), os.dup(1)
    os.dup2(2, 1)  # what the FMU prints must not be taken for an answer
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    serve(source, answers)
    sys.stdout.flush()


if __name__ == "__main__":
    main()
