"""The parent of a worker: unpacks an FMU, has its instances stepped in another process, and watches over it."""

import os
import select
import signal
import struct
import subprocess
import sys
import time
import zipfile
from collections.abc import Sequence
from io import BytesIO
from tempfile import TemporaryDirectory

import msgspec

from phototaxis_sensors.fmu.description import UNPACKING, Fmu
from phototaxis_sensors.fmu.wiring import Wiring, size
from phototaxis_sensors.fmu.worker import BEGIN, HEAD, LENGTH, STEP, Setup

LOADING = 30.0
"""Seconds that an FMU may take to be loaded."""


def stay_on_one_cpu() -> None:
    """Keep this thread, and the processes that it starts, on one CPU.

    An FMU and its parent never compute at the same time, and to wake a process on the same CPU takes a tenth of
    the time: measured 6 µs in place of 47 there and back.
    """
    if hasattr(os, "sched_setaffinity"):
        allowed = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {allowed[os.getpid() % len(allowed)]})


class Failed(Exception):
    """The FMU crashed, hung, or said that it cannot go on."""


class Host:
    """Instances of one FMU in a process of their own.

    Parameters
    ----------
    fmu, wiring : what is run, and how it is connected.
    instances : how many; all are stepped together.
    period : length of a step, s.
    timeout : seconds after which a silent process is killed.
    archive : the FMU's archive where it is not that of its file.
    """

    def __init__(
        self, fmu: Fmu, wiring: Wiring, instances: int, period: float, timeout: float, archive: bytes | None = None
    ):
        self._fmu, self._wiring, self._period, self._timeout = fmu, wiring, period, timeout
        self._instances, self._archive = instances, archive
        self._values_in = sum(map(size, wiring.inputs))
        self._values_out = wiring.width
        self._request = struct.Struct(f"<qq{self._values_in * instances}d")
        self._answer = struct.Struct(f"<qq{self._values_out * instances}d")
        self._folder: TemporaryDirectory[str] | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._to = self._from = -1
        self._poll = select.poll()

    def start(self) -> None:
        """Load the FMU in a fresh process.

        Raises
        ------
        Failed
            when it cannot be loaded.
        """
        self.stop()
        self._folder = TemporaryDirectory(prefix="phototaxis-fmu-", ignore_cleanup_errors=True)
        folder = self._folder.name
        self._unpack(folder)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "phototaxis_sensors.fmu.worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True,
        )  # fmt: skip
        assert self._process.stdin is not None  # noqa: S101 - said to the type checker: both are pipes
        assert self._process.stdout is not None  # noqa: S101
        self._to, self._from = self._process.stdin.fileno(), self._process.stdout.fileno()
        self._poll = select.poll()
        self._poll.register(self._from, select.POLLIN)
        setup = msgspec.json.encode(self._setup(folder))
        self._write(LENGTH.pack(len(setup)) + setup)
        self._read(HEAD.size, LOADING)

    def begin(self, inputs: Sequence[float]) -> None:
        """Reset all instances and initialise them with these inputs."""
        self._write(self._request.pack(BEGIN, 1, *inputs))
        self._read(self._answer.size, self._timeout)

    def step(self, inputs: Sequence[float], count: int = 1) -> tuple[float, ...]:
        """Step all instances by `count` periods; their outputs, one instance after the other.

        Raises
        ------
        Failed
            when it does not answer, or says that it failed; the process is then ended.
        """
        self._write(self._request.pack(STEP, count, *inputs))
        return self._answer.unpack(self._read(self._answer.size, self._timeout))[2:]

    def stop(self) -> None:
        """End the process and remove what was unpacked."""
        process, self._process = self._process, None
        if process is not None:
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    stream.close()
            try:
                process.wait(self._timeout)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    @property
    def pid(self) -> int:
        """Of the process; 0 when there is none."""
        return 0 if self._process is None else self._process.pid

    def _setup(self, folder: str) -> Setup:
        interface, wiring = self._fmu.interface, self._wiring
        return Setup(
            folder=folder, version=self._fmu.version, identifier=interface.modelIdentifier or "",
            token=self._fmu.description.guid or "", instances=self._instances,
            inputs=[wire.variable.valueReference for wire in wiring.inputs], values_in=self._values_in,
            outputs=[wire.variable.valueReference for wire in wiring.outputs], values_out=self._values_out,
            parameters=[(one.kind, one.reference, one.value) for one in wiring.parameters], period=self._period,
        )  # fmt: skip

    def _unpack(self, folder: str) -> None:
        try:
            with zipfile.ZipFile(self._fmu.file if self._archive is None else BytesIO(self._archive)) as archive:
                archive.extractall(folder)  # it strips what would lead out of the folder
        except UNPACKING as error:
            raise Failed(f"cannot be unpacked: {error}") from None

    def _write(self, data: bytes) -> None:
        try:
            while data:
                data = data[os.write(self._to, data) :]
        except BrokenPipeError:
            self._read(HEAD.size, self._timeout)  # its last words, or the way it died

    def _read(self, size: int, timeout: float) -> bytes:
        answer, deadline = b"", time.monotonic() + timeout
        while len(answer) < size:
            if not self._poll.poll(max(deadline - time.monotonic(), 0.0) * 1000):
                self._kill()
                raise Failed(f"gave no answer within {timeout:g} s and was ended")
            got = os.read(self._from, 65536)
            if not got:
                raise Failed(self._died())
            answer += got
            if len(answer) >= HEAD.size and (bad := HEAD.unpack_from(answer))[0]:
                size = HEAD.size + bad[1]
        if HEAD.unpack_from(answer)[0]:
            self._kill()
            raise Failed(answer[HEAD.size :].decode(errors="replace"))
        return answer

    def _kill(self) -> None:
        if self._process is not None:
            self._process.kill()
        self.stop()

    def _died(self) -> str:
        process = self._process
        code = process.wait() if process is not None else 0
        self.stop()
        return f"crashed with {signal.Signals(-code).name}" if code < 0 else f"ended its process with code {code}"


class Team:
    """Instances of an FMU of which a process can have only one: a process each; otherwise as a `Host`."""

    def __init__(self, members: Sequence[Host]):
        self._members = members

    def start(self) -> None:
        for member in self._members:
            member.start()

    def begin(self, inputs: Sequence[float]) -> None:
        for member, part in zip(self._members, self._parts(inputs), strict=True):
            member.begin(part)

    def step(self, inputs: Sequence[float], count: int = 1) -> tuple[float, ...]:
        parts = zip(self._members, self._parts(inputs), strict=True)
        return tuple(value for member, part in parts for value in member.step(part, count))

    def stop(self) -> None:
        for member in self._members:
            member.stop()

    def _parts(self, inputs: Sequence[float]) -> list[Sequence[float]]:
        size = len(inputs) // len(self._members)
        return [inputs[at : at + size] for at in range(0, len(inputs), size)]
