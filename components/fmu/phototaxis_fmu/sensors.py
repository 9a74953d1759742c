"""Replaces built-in sensor models by FMUs, as the options say."""

import math
from typing import NamedTuple

from phototaxis.geometry.arena import Arena
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.wire.messages import World
from phototaxis_sensors.light import Sights
from phototaxis_sensors.model import SensorModel
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.suite import Models, built_in

from phototaxis_fmu.assign import assign
from phototaxis_fmu.batch import FmuBatch, InstanceBatch
from phototaxis_fmu.build import compiled
from phototaxis_fmu.description import Fmu, read, require_library
from phototaxis_fmu.host import Failed, Host, Team, Terms, stay_on_one_cpu
from phototaxis_fmu.log import MAX_LINES, MAX_LINES_ON_REQUEST, Log
from phototaxis_fmu.model import FmuModel, Stepped
from phototaxis_fmu.pace import plan_steps
from phototaxis_fmu.rigs import Beams, Filters, Lamps, Rig
from phototaxis_fmu.wiring import SUITES, Wiring, connect

MAX_PROCESSES = 64
"""Most processes for an FMU that allows only one instance per process."""


class Wired(NamedTuple):
    """An FMU and how it is connected."""

    kind: str
    """light or sonar"""
    fmu: Fmu
    wiring: Wiring
    archive: bytes | None
    """Content of the FMU with a library compiled here; None if its file has one for this machine."""
    log: Log


class FmuSensors:
    """Makes the sensor models of a robot: an FMU where the options name one, else the built-in model.

    With `one_cpu`, the calling thread and the FMUs stay on one CPU; with `logging`, the FMUs' logging is on.

    Raises
    ------
    UserError
        when an FMU cannot be used, or an option does not fit it.
    """

    stateful = True

    def __init__(self, options: FmuOptions, one_cpu: bool = False, logging: bool = False):
        self._options, self._one_cpu = options, one_cpu
        files = {"light": options.light_fmu, "sonar": options.sonar_fmu}
        fmus = {kind: read(file, options.allow_invalid) for kind, file in files.items() if file}
        names, parameters = assign(options.fmu_map, options.fmu_param, fmus)
        self._wired: dict[str, Wired] = {}
        for kind, fmu in fmus.items():
            wiring = connect(fmu, SUITES[kind], names[kind], parameters[kind])
            require_library(fmu, options.allow_compile)
            most = MAX_LINES_ON_REQUEST if options.fmu_log else MAX_LINES
            log = Log(f"{kind} FMU {fmu.name}", options.fmu_log or logging, most)
            self._wired[kind] = Wired(kind, fmu, wiring, None if fmu.compiled else compiled(fmu.file), log)
        self._running: list[Host | Team] = []

    def try_out(self) -> None:
        """Load each FMU once, so that its errors show before a run."""
        for wired in self._wired.values():
            self._host(wired, 1, self._options.fmu_step or 1.0, quiet=True)
        self.close()

    @property
    def begins(self) -> str:
        """How the FMU's episodes begin, as in "a reset"; it changes when the FMU turns out not to reset."""
        return self._running[0].begins

    def __call__(self, arena: Arena, scene: Scene) -> Models:
        """Make the models for an arena; this ends those made before."""
        self.close()
        if self._one_cpu:
            stay_on_one_cpu()
        sonar, light = built_in(arena, scene)
        for wired in self._wired.values():
            if wired.kind == "sonar":
                sonar = self._model(wired, arena, Beams(wired.wiring, arena, sonar), sonar)
            elif wired.wiring.ports == ["raw"]:
                light = self._model(wired, arena, Filters(wired.wiring, light), light)
            else:
                light = self._model(wired, arena, Lamps(wired.wiring, arena, Sights(arena, scene)), light)
        return Models(sonar, light)

    def batch(self, world: World, count: int) -> FmuBatch:
        """Make the sensors of `count` robots in a world; this ends the models made before."""
        self.close()
        arena, crews = world.arena, dict[str, InstanceBatch]()
        for kind, wired in self._wired.items():
            sensors = len(arena.robot.sonars) // wired.wiring.width if kind == "sonar" else 2
            each = sensors * (len(arena.lights) if kind == "light" and wired.wiring.ports != ["raw"] else 1)
            host = self._host(wired, count * each, arena.motion.control_period)
            crews[kind] = InstanceBatch(self._stepped(host, wired), wired.wiring)
        return FmuBatch(world, crews.get("sonar"), crews.get("light"))

    def close(self) -> None:
        """End the FMUs' processes."""
        while self._running:
            self._running.pop().stop()

    def _host(self, wired: Wired, instances: int, period: float, quiet: bool = False) -> Host | Team:
        """Start processes and load the FMU in them; with `quiet`, print no remark about its step size."""
        options = self._options
        if wired.fmu.once and instances > MAX_PROCESSES:
            raise UserError(
                f"{wired.fmu.file}: allows one instance per process, and {instances} instances are needed; "
                f"at most {MAX_PROCESSES} processes are allowed (with evaluate, lower --placements)"
            )
        found = plan_steps(wired.fmu.description, period, options.fmu_step)
        if found.remark and not quiet:
            wired.log.tell(found.remark)
        terms = Terms(wired.fmu, wired.wiring, found, wired.log, options.fmu_timeout, options.fmu_fresh, wired.archive)
        if wired.fmu.once and instances > 1:
            host = Team([Host(terms, 1) for _ in range(instances)])
        else:
            host = Host(terms, instances)
        try:
            host.start()
        except Failed as why:
            host.stop()
            raise UserError(f"{wired.fmu.file}: {why}") from None
        self._running.append(host)
        return host

    def _model(self, wired: Wired, arena: Arena, rig: Rig, builtin: SensorModel) -> FmuModel:
        period = arena.motion.control_period
        host = self._host(wired, rig.instances, period)
        return FmuModel(self._stepped(host, wired, period), rig, builtin, wired.fmu.name)

    def _stepped(self, host: Host | Team, wired: Wired, in_time: float = math.inf) -> Stepped:
        return Stepped(host, wired.wiring, in_time, wired.log.label, self._options.fmu_fallback)
