"""Puts FMUs in the place of the built-in sensor models, as the options say."""

import sys
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from phototaxis.arena import Arena
from phototaxis.errors import UserError
from phototaxis.fmu import FmuOptions
from phototaxis.messages import World

from phototaxis_sensors.fmu.build import compiled
from phototaxis_sensors.fmu.crowd import Crew, FmuCrowd
from phototaxis_sensors.fmu.description import Fmu, read, require_library
from phototaxis_sensors.fmu.host import Failed, Host, Team, stay_on_one_cpu
from phototaxis_sensors.fmu.model import FmuModel, Stepped
from phototaxis_sensors.fmu.rigs import Beams, Filters, Lamps, Rig
from phototaxis_sensors.fmu.wiring import SUITES, Wiring, connect
from phototaxis_sensors.light import Sights
from phototaxis_sensors.model import SensorModel
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.suite import Models, built_in

PROCESSES = 64
"""Most processes for an FMU of which a process can have only one instance."""


class Wired(NamedTuple):
    """An FMU and how it is connected."""

    kind: str
    """light or sonar"""
    fmu: Fmu
    wiring: Wiring
    archive: bytes | None
    """The FMU with a library that was compiled for it; None where it brought one."""

    @property
    def label(self) -> str:
        return f"{self.kind} FMU {self.fmu.name}"


class FmuSensors:
    """Makes the models of a suite: FMUs where the options name one, else the built-in ones.

    With `one_cpu` the thread that uses them stays on one CPU, with the FMUs.

    Raises
    ------
    UserError
        when an FMU cannot be used, or an option does not fit it.
    """

    remembers = True

    def __init__(self, options: FmuOptions, one_cpu: bool = False):
        self._options, self._one_cpu = options, one_cpu
        files = {"light": options.light_fmu, "sonar": options.sonar_fmu}
        given = [kind for kind, file in files.items() if file]
        names, parameters = _pairs("fmu-map", options.fmu_map, given), _pairs("fmu-param", options.fmu_param, given)
        self._wired: dict[str, Wired] = {}
        for kind in given:
            fmu = read(files[kind])
            wiring = connect(fmu, SUITES[kind], names[kind], parameters[kind])
            require_library(fmu, options.allow_compile)
            self._wired[kind] = Wired(kind, fmu, wiring, None if fmu.compiled else compiled(fmu.file))
        self._running: list[Host | Team] = []

    def try_out(self, period: float = 0.1) -> None:
        """Load each FMU once, so that what is wrong is said before a run."""
        for wired in self._wired.values():
            self._host(wired, 1, period)
        self.close()

    def __call__(self, arena: Arena, scene: Scene) -> Models:
        """The models for an arena; those made before are ended."""
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

    def crowd(self, world: World, count: int) -> FmuCrowd:
        """The sensors of `count` robots in a world; models made before are ended."""
        self.close()
        arena, crews = world.arena, dict[str, Crew]()
        for kind, wired in self._wired.items():
            sensors = len(arena.robot.sonars) // wired.wiring.width if kind == "sonar" else 2
            each = sensors * (len(arena.lights) if kind == "light" and wired.wiring.ports != ["raw"] else 1)
            self._warn(wired, arena.motion.control_period)
            host = self._host(wired, count * each, arena.motion.control_period)
            crews[kind] = Crew(self._stepped(host, wired), wired.wiring)
        return FmuCrowd(world, crews.get("sonar"), crews.get("light"))

    def close(self) -> None:
        """End the FMUs' processes."""
        while self._running:
            self._running.pop().stop()

    def _host(self, wired: Wired, instances: int, period: float) -> Host | Team:
        options = self._options
        rest = period, options.fmu_timeout, wired.archive
        if wired.fmu.once and instances > PROCESSES:
            raise UserError(
                f"{wired.fmu.file}: a process can have it once, and {instances} instances are needed; "
                f"at most {PROCESSES} processes are started (with evaluate: fewer --placements)"
            )
        if wired.fmu.once and instances > 1:
            host = Team([Host(wired.fmu, wired.wiring, 1, *rest) for _ in range(instances)])
        else:
            host = Host(wired.fmu, wired.wiring, instances, *rest)
        try:
            host.start()
        except Failed as why:
            host.stop()
            raise UserError(f"{wired.fmu.file}: {why}") from None
        self._running.append(host)
        return host

    def _warn(self, wired: Wired, period: float) -> None:
        """Say so when the FMU would rather be stepped otherwise."""
        experiment = wired.fmu.description.defaultExperiment
        step = float(experiment.stepSize) if experiment is not None and experiment.stepSize else period
        if step != period:
            line = f"{wired.label} suggests steps of {step:g} s; it gets steps of {period:g} s, the control period"
            print(f"sensors: {line}", file=sys.stderr, flush=True)

    def _model(self, wired: Wired, arena: Arena, rig: Rig, builtin: SensorModel) -> FmuModel:
        self._warn(wired, arena.motion.control_period)
        host = self._host(wired, rig.instances, arena.motion.control_period)
        return FmuModel(self._stepped(host, wired), rig, builtin, wired.fmu.name)

    def _stepped(self, host: Host | Team, wired: Wired) -> Stepped:
        return Stepped(host, wired.wiring, wired.label, self._options.fmu_fallback)


def _pairs(flag: str, items: Sequence[str], given: Sequence[str]) -> Mapping[str, dict[str, str]]:
    """NAME=VALUE options of each FMU."""
    found: dict[str, dict[str, str]] = {kind: {} for kind in given}
    for item in items:
        name, equals, value = item.partition("=")
        kind, dot, rest = name.partition(".")
        if not equals or not name:
            raise UserError(f"--{flag} {item}: expected NAME=VALUE")
        if not given:
            raise UserError(f"--{flag} {item}: there is no FMU; give --light-fmu or --sonar-fmu")
        if dot and kind in SUITES:
            if kind not in found:
                raise UserError(f"--{flag} {item}: there is no --{kind}-fmu")
            found[kind][rest] = value
        elif len(given) > 1:
            raise UserError(f"--{flag} {item}: of which FMU? say light.{name}=… or sonar.{name}=…")
        else:
            found[given[0]][name] = value
    return found
