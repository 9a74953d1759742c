"""The parent side of a worker: unpacks an FMU, steps its instances in another process, and supervises that process."""

import os
import select
import signal
import struct
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from io import BytesIO
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec

from phototaxis_fmu.description import UNPACKING_ERRORS, Fmu
from phototaxis_fmu.instance import InstanceSetup, ends
from phototaxis_fmu.log import Listener, Log
from phototaxis_fmu.pace import StepPlan
from phototaxis_fmu.wiring import Wire, Wiring, size
from phototaxis_fmu.worker import BEGIN, FAILED, HEAD, LENGTH, REPLACED, STEP

LOADING_S = 30.0
"""Seconds that an FMU may take to be loaded."""
LOOK_EVERY_S = 0.1
"""Seconds between two checks whether a silent worker still lives: a helper process of the FMU may keep the pipes of
a dead worker open."""
GUARD = 'read -r _; rm -rf -- "$2"; kill -s KILL -- "-$1"; rm -rf -- "$2"'
"""A shell script that waits until its parent has ended, even by a crash; then it removes a folder and kills a process
group. It removes the folder twice, since the group may have written into it meanwhile."""


def stay_on_one_cpu() -> None:
    """Keep this thread, and the processes that it starts, on one CPU.

    An FMU and its parent never compute at the same time, and waking a process on the same CPU is faster: a measured
    round trip took 6 µs instead of 47 µs.
    """
    if hasattr(os, "sched_setaffinity"):
        allowed = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {allowed[os.getpid() % len(allowed)]})


class Failed(Exception):
    """The FMU crashed, hung, or reported an error."""


class Killed(Failed):
    """Somebody else has killed the FMU's process."""


class Terms(NamedTuple):
    """The settings that all processes of an FMU share."""

    fmu: Fmu
    wiring: Wiring
    pace: StepPlan
    log: Log
    timeout: float = 5.0
    """Seconds after which a silent process is killed."""
    fresh: bool = False
    """Whether each episode gets a fresh instance instead of a reset."""
    archive: bytes | None = None
    """The FMU's archive if it was compiled here; None: it is the file itself."""


class Host:
    """Runs instances of one FMU in a process of their own.

    Parameters
    ----------
    terms : the FMU, its wiring and its settings.
    instances : number of instances; all are stepped together.

    Attributes
    ----------
    begins : how an episode begins: with "a reset", "a fresh instance" or "a fresh process".
    """

    def __init__(self, terms: Terms, instances: int):
        self._terms, self._instances = terms, instances
        values_in = sum(map(size, terms.wiring.inputs))
        self._request = struct.Struct(f"<qq{values_in * instances}d")
        self._answer = struct.Struct(f"<qq{terms.wiring.width * instances}d")
        self._folder: TemporaryDirectory[str] | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._guard: subprocess.Popen[bytes] | None = None
        self._listener: Listener | None = None
        self._to = self._from = -1
        self._poll = select.poll()
        self._begun = False
        self.begins = f"a fresh {'process' if terms.fmu.once else 'instance'}" if terms.fresh else "a reset"
        self._logging = terms.log.everything

    def start(self, logging: bool = False) -> None:
        """Load the FMU in a fresh process; with `logging`, its logging is on from now on.

        Raises
        ------
        Failed
            when the FMU cannot be loaded.
        """
        self.stop()
        self._logging |= logging
        self._folder = TemporaryDirectory(prefix="phototaxis-fmu-", ignore_cleanup_errors=True)
        folder = self._folder.name
        self._unpack(folder)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "phototaxis_fmu.worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        self._guard = subprocess.Popen(
            ["/bin/sh", "-c", GUARD, "phototaxis-fmu-guard", str(self._process.pid), folder],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        to, answers, says = self._process.stdin, self._process.stdout, self._process.stderr
        assert to and answers and says  # noqa: S101, PT018 - tells the type checker that all are pipes
        self._listener = Listener(says, self._terms.log)
        self._to, self._from = to.fileno(), answers.fileno()
        self._poll = select.poll()
        self._poll.register(self._from, select.POLLIN)
        setup = msgspec.json.encode(self._setup(folder))
        self._write(LENGTH.pack(len(setup)) + setup)
        self._read(HEAD.size, LOADING_S)

    def begin(self, inputs: Sequence[float]) -> None:
        """Begin an episode with these inputs: reset or replace all instances.

        An instance that cannot be reset is replaced by a fresh one; if the FMU dies of it, by a fresh process.

        Raises
        ------
        Failed
            when the fresh process fails too.
        """
        if self._begun and self.begins == "a fresh process":
            self.start()
        if not self._begun or not self._alive():
            self._begin(inputs)
            return
        try:
            self._begin(inputs)
        except Killed:
            raise
        except Failed as why:
            self.start()
            self._begin(inputs)
            self._cannot_be_reset(str(why), "a fresh process")

    def step(self, inputs: Sequence[float], count: int = 1) -> tuple[float, ...]:
        """Step all instances by `count` control periods, and return their outputs, instance by instance.

        Raises
        ------
        Failed
            when the FMU does not answer, or reports an error; its process is then ended.
        """
        self._write(self._request.pack(STEP, count, *inputs))
        return self._answer.unpack(self._read(self._answer.size, self._terms.timeout))[2:]

    def stop(self) -> None:
        """End the process and all processes that it has started, and remove the unpacked files."""
        process, self._process = self._process, None
        if process is not None:
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    stream.close()
            with suppress(subprocess.TimeoutExpired):
                process.wait(self._terms.timeout)
            _end_group(process)
        if self._listener is not None:
            self._listener.finish()
            self._listener = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        if self._guard is not None:
            self._guard.kill()
            self._guard.communicate()
            self._guard = None
        self._begun = False

    @property
    def pid(self) -> int:
        """The process id; 0 when there is no process."""
        return 0 if self._process is None else self._process.pid

    def _setup(self, folder: str) -> InstanceSetup:
        fmu, wiring, pace = self._terms.fmu, self._terms.wiring, self._terms.pace
        return InstanceSetup(
            folder=folder, version=fmu.version, identifier=fmu.interface.modelIdentifier or "",
            token=fmu.description.guid or "", instances=self._instances,
            inputs=ends([_end(wire) for wire in wiring.inputs]), outputs=ends([_end(wire) for wire in wiring.outputs]),
            parameters=wiring.parameters, step=pace.step, times=pace.times, fresh=self._terms.fresh, once=fmu.once,
            logging=self._logging, least=0 if self._terms.log.everything else 1,
        )  # fmt: skip

    def _unpack(self, folder: str) -> None:
        archive = self._terms.archive
        try:
            with zipfile.ZipFile(self._terms.fmu.file if archive is None else BytesIO(archive)) as members:
                members.extractall(folder)  # it drops the parts of a path that lead out of the folder
        except UNPACKING_ERRORS as error:
            raise Failed(f"cannot be unpacked: {error}") from None

    def _begin(self, inputs: Sequence[float]) -> None:
        self._write(self._request.pack(BEGIN, 1, *inputs))
        self._read(self._answer.size, self._terms.timeout)
        self._begun = True

    def _cannot_be_reset(self, why: str, instead: str) -> None:
        self.begins = instead
        self._terms.log.tell(f"cannot be reset ({why}): each episode begins with {instead}")

    def _write(self, data: bytes) -> None:
        try:
            while data:
                data = data[os.write(self._to, data) :]
        except BrokenPipeError:
            self._read(HEAD.size, self._terms.timeout)  # raises Failed with the reason that the worker gave or left

    def _read(self, size: int, timeout: float) -> bytes:
        answer, left = b"", timeout
        while True:
            if not self._poll.poll(min(left, LOOK_EVERY_S) * 1000):
                if not self._alive():
                    raise self._died()
                left -= LOOK_EVERY_S
                if left <= 0:
                    raise Failed(self._end(f"gave no answer within {timeout:g} s and was ended"))
                continue
            got = os.read(self._from, 65536)
            if not got:
                raise self._died()
            answer += got
            while len(answer) >= HEAD.size:
                kind, length = HEAD.unpack_from(answer)
                whole = HEAD.size + length if kind in (FAILED, REPLACED) else size
                if len(answer) < whole:
                    break
                if kind == REPLACED:
                    self._cannot_be_reset(answer[HEAD.size : whole].decode(), "a fresh instance")
                    answer = answer[whole:]
                    continue
                if kind == FAILED:
                    raise Failed(self._end(answer[HEAD.size : whole].decode()))
                return answer

    def _alive(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def _died(self) -> Failed:
        try:
            code = self._process.wait(LOOK_EVERY_S) if self._process is not None else 0
        except subprocess.TimeoutExpired:
            return Failed(self._end("closed the pipes to its parent and was ended"))
        how = f"crashed with {signal.Signals(-code).name}" if code < 0 else f"ended its process with code {code}"
        return (Killed if code == -signal.SIGKILL else Failed)(self._end(how))

    def _end(self, why: str) -> str:
        """End a process that failed, and return why it failed, with the last line of its output."""
        if self._process is not None:
            self._process.kill()
        listener = self._listener
        self.stop()
        words = listener.last if listener is not None else ""
        return why if not words or words in why else f"{why}; its last output: {words}"


class Team:
    """Runs instances of an FMU that allows one instance per process: one `Host` for each, and used like a `Host`."""

    def __init__(self, members: Sequence[Host]):
        self._members = members

    @property
    def begins(self) -> str:
        return self._members[0].begins

    def start(self, logging: bool = False) -> None:
        for member in self._members:
            member.start(logging)

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


def _end(wire: Wire) -> tuple[str, int, int]:
    return wire.variable.type, wire.variable.valueReference, size(wire)


def _end_group(leader: "subprocess.Popen[bytes]") -> None:
    """Kill a process and all processes of its group; the leader may have ended by itself."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(leader.pid, signal.SIGKILL)
    leader.wait()
