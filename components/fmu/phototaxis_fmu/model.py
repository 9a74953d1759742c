"""Makes an FMU a sensor model: steps it at each tick, resets it at each episode, and restarts it when it fails."""

import math
import sys
import time
from collections import deque
from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple

from phototaxis.runtime.errors import ComponentFailed
from phototaxis_sensors.model import BuiltIn, Moment, SensorModel

from phototaxis_fmu.host import Failed, Host, Team
from phototaxis_fmu.rigs import Rig
from phototaxis_fmu.start import bounds
from phototaxis_fmu.wiring import Wire, Wiring, size

MAX_RESTARTS, RESTART_WINDOW_S = 3, 60.0
"""We give up on an FMU that fails more than MAX_RESTARTS times within RESTART_WINDOW_S seconds."""
ROUNDING = 1e-6
"""How far an output may exceed its limits, relative to them; enough for rounding in single precision."""
MAX_FLOAT = sys.float_info.max
MAX_REMEMBERED_TICKS = 100_000
"""Ticks of an episode whose inputs are kept, to repeat them with a restarted FMU."""


class Step(NamedTuple):
    """The inputs of the FMU at one tick."""

    periods: int
    """Control periods since the previous tick; more than 1 if ticks were missed."""
    inputs: list[float]


class Stepped:
    """Steps instances of an FMU through an episode, and restarts their process when it fails.

    A restarted FMU gets all inputs of the episode again, so that its state is the same as before the failure.

    Parameters
    ----------
    host : the process or processes of the instances.
    wiring : the connections of one instance.
    in_time : seconds for a tick above which the FMU counts as slow.
    label : names the FMU in messages, as in "light FMU lag.fmu".
    fallback : whether to give the FMU up when it keeps failing; if not, that is an error.

    Attributes
    ----------
    failed : whether the FMU has been given up.
    """

    def __init__(self, host: Host | Team, wiring: Wiring, in_time: float, label: str, fallback: bool):
        self.label, self._host, self._fallback, self.failed = label, host, fallback, False
        self._in_time = in_time
        self._episode, self._tick = -1, -1
        self._steps: deque[Step] = deque(maxlen=MAX_REMEMBERED_TICKS)
        self._failures: deque[float] = deque(maxlen=MAX_RESTARTS + 1)
        outputs = self._outputs = [wire for wire in wiring.outputs for _ in range(size(wire))]
        self._limits = [_limits(wire) for wire in outputs]
        self._plain = all((wire.factor, wire.offset) == (1, 0) for wire in outputs)
        self.anew = -1
        """Tick at which a restarted FMU lost the earlier part of its episode; −1: never."""

    def __call__(self, episode: int, tick: int, inputs: list[float]) -> Sequence[float] | None:
        """Return the outputs of all instances, in our units; None after the FMU was given up.

        Raises
        ------
        ComponentFailed
            when the FMU keeps failing and there is no fallback.
        """
        if self.failed:
            return None
        fresh = episode != self._episode
        if fresh:
            self._steps.clear()
        step = Step(1 if fresh else tick - self._tick, inputs)
        self._steps.append(step)
        self._episode, self._tick = episode, tick
        try:
            if fresh:
                self._host.begin(inputs)
            began = time.monotonic()
            outputs = self._checked(self._host.step(inputs, step.periods))
            if (seconds := time.monotonic() - began) > self._in_time * step.periods:
                self._slow(seconds / step.periods)
        except Failed as why:
            outputs = self._again(why)
        if outputs is None or self._plain:
            return outputs
        return [(value - wire.offset) / wire.factor for value, wire in zip(outputs, cycle(self._outputs), strict=False)]

    def _slow(self, seconds: float) -> None:
        """Warn, only once, that the FMU cannot keep up with real time."""
        line = f"took {seconds:.2g} s for tick {self._tick}; in real time a tick lasts {self._in_time:g} s"
        print(f"sensors: {self.label}: {line}", file=sys.stderr, flush=True)
        self._in_time = math.inf

    def _again(self, why: Failed) -> Sequence[float] | None:
        """Restart the FMU and repeat the episode with it, or give the FMU up."""
        while True:
            self._failures.append(time.monotonic())
            line = f"{self.label}: {why} at tick {self._tick}"
            if len(self._failures) > MAX_RESTARTS and self._failures[-1] - self._failures[0] < RESTART_WINDOW_S:
                self._host.stop()
                line = f"{line}, after {MAX_RESTARTS} restarts"
                if not self._fallback:
                    raise ComponentFailed(line)
                print(f"sensors: {line}; the built-in model takes its place", file=sys.stderr, flush=True)
                self.failed = True
                return None
            print(f"sensors: {line}; restarted", file=sys.stderr, flush=True)
            if len(self._steps) == MAX_REMEMBERED_TICKS:
                self.anew = self._tick
            try:
                self._host.start(logging=True)
                self._host.begin(self._steps[0].inputs)
                outputs: Sequence[float] = ()
                for step in self._steps:
                    outputs = self._host.step(step.inputs, step.periods)
                return self._checked(outputs)
            except Failed as error:
                why = error

    def _checked(self, outputs: Sequence[float]) -> Sequence[float]:
        """Return the outputs, clipped to their limits if they exceed them only by rounding; else raise `Failed`."""
        for value, (low, high) in zip(outputs, cycle(self._limits), strict=False):
            if not low <= value <= high:  # true for NaN too
                return self._clipped(outputs)
        return outputs

    def _clipped(self, outputs: Sequence[float]) -> Sequence[float]:
        clipped = []
        for value, (low, high), wire in zip(outputs, cycle(self._limits), cycle(self._outputs), strict=False):
            if not low - _rounding(low, wire) <= value <= high + _rounding(high, wire):
                self._host.stop()
                raise Failed(f"its {wire.variable.name} is {value:g}, {_words(low, high)}")
            clipped.append(min(max(value, low), high))
        return clipped


def _limits(wire: Wire) -> tuple[float, float]:
    """Return the limits of an output, in its own unit: the declared ones, and finite."""
    low, high = bounds(wire.variable)
    return max(low, -MAX_FLOAT), min(high, MAX_FLOAT)


def _rounding(limit: float, wire: Wire) -> float:
    """Return how far an output may exceed a limit by rounding: relative to the limit, or to 1 in our unit if larger."""
    return ROUNDING * max(abs(limit), abs(wire.factor)) if abs(limit) < MAX_FLOAT else 0.0


def _words(low: float, high: float) -> str:
    if (low, high) == (-MAX_FLOAT, MAX_FLOAT):
        return "not a finite number"
    if high == MAX_FLOAT:
        return f"below {low:g}"
    return f"above {high:g}" if low == -MAX_FLOAT else f"not in {low:g} to {high:g}"


class FmuModel:
    """A sensor model whose readings come from an FMU.

    Parameters
    ----------
    stepped : the FMU's instances.
    rig : computes the inputs of the instances, and the readings from their outputs.
    builtin : the model that replaces the FMU after it was given up.
    """

    def __init__(self, stepped: Stepped, rig: Rig, builtin: SensorModel, name: str):
        self._stepped, self._rig, self._builtin, self._name = stepped, rig, builtin, name

    stateful = True

    @property
    def name(self) -> str:
        if self._stepped.failed:
            return f"{BuiltIn.name}, as {self._name} failed"
        anew = self._stepped.anew
        return self._name if anew < 0 else f"{self._name}, its state begun anew at tick {anew}"

    def begun_anew(self, tick: int) -> None:
        """Note that the FMU knows nothing of the episode before this tick."""
        self._stepped.anew = tick

    def __call__(self, moment: Moment) -> Sequence[float]:
        outputs = self._stepped(moment.episode, moment.tick, self._rig.feed(moment))
        return self._builtin(moment) if outputs is None else self._rig.collect(outputs)
