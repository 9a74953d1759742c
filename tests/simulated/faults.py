"""What each kind of fault does to a storm."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from msgspec.structs import replace
from phototaxis.runtime.machine import Event
from phototaxis.wire.messages import Control

from simulated.process import Process
from simulated.schedule import Fault
from simulated.stray import Stray
from simulated.system import BACK_AFTER_S

if TYPE_CHECKING:
    from simulated.storm import Storm

HANGS_FOR_S = 7.0
"""So long a driver hangs: it loses the seat before."""
LOOKS_EVERY_S = 0.001
"""Seconds after which it is looked again whether a standby is named."""


def kill(storm: Storm, fault: Fault, role: str) -> None:
    """The process dies in the midst of its next effects, and is started again."""
    process = storm.of(role)
    if storm.may_die(process):
        process.kill_in, process.tear = fault.effects, fault.tear


def restarts(storm: Storm, fault: Fault, role: str) -> None:
    """It dies again and again, each time soon after it has come back."""
    kill(storm, fault, role)
    if fault.number > 1:
        later = BACK_AFTER_S * (1 + fault.seconds)
        storm.system.timeline.after(later, restarts, storm, replace(fault, number=fault.number - 1), role)


def freeze(storm: Storm, fault: Fault, role: str) -> None:
    """It stands still for a while, and then finds all that has come."""
    _freeze(storm, storm.of(role), fault.seconds)


def hang(storm: Storm, fault: Fault, role: str) -> None:
    """The driver stands still for so long that the standby gets its seat."""
    if storm.standby_is_named():
        _freeze(storm, storm.of("agent"), HANGS_FOR_S)


def lose(storm: Storm, fault: Fault, role: str) -> None:
    """The driver dies for good as soon as the simulation names a standby; another agent comes and stands by."""
    if storm.may_die(storm.of("agent")):
        storm.of("agent").kill()
        storm.replace_driver()
    elif fault.seconds > 0:
        later = replace(fault, seconds=fault.seconds - LOOKS_EVERY_S)
        storm.system.timeline.after(LOOKS_EVERY_S, lose, storm, later, role)


def swap(storm: Storm, fault: Fault) -> None:
    """An agent of the same kind takes over; one that dies before it hands over takes what it knows with it."""
    agent = storm.of("agent")
    if not agent.dead and agent.kill_in is None and storm.system.driver == agent.ident:
        storm.take_over()


def part(storm: Storm, fault: Fault, one: str, other: str = "") -> None:
    """Nothing passes between two roles, or between one and all others."""
    network = storm.system.network

    def cut(a: Process, b: Process) -> bool:
        return a.role != b.role and one in (a.role, b.role) and other in ("", a.role, b.role)

    network.part(cut)
    storm.system.timeline.after(fault.seconds, network.mend, cut)


def full(storm: Storm, fault: Fault, role: str) -> None:
    """Its disk takes no entry for a while."""
    process = storm.of(role)
    if not process.dead and process.kill_in is None:
        disk = storm.system.disks[process.ident]
        disk.full = True
        storm.system.timeline.after(fault.seconds, setattr, disk, "full", False)


def stray(storm: Storm, fault: Fault) -> None:
    """Somebody publishes what must change nothing."""
    system = storm.system
    Stray(system.network, system.rng, system.witness).speak(system.timeline.now + fault.seconds)


def pause(storm: Storm, fault: Fault) -> None:
    """An operator pauses the run, makes single steps, and lets it go on."""
    _request(storm, Control(verb="pause"), *[Control(verb="step")] * fault.number)
    storm.system.timeline.after(fault.seconds, _request, storm, Control(verb="resume"))


def speed(storm: Storm, fault: Fault) -> None:
    """An operator lets the run go by the clock for a while."""
    _request(storm, Control(verb="speed", speed=10.0 * fault.number))
    storm.system.timeline.after(fault.seconds, _request, storm, Control(verb="speed"))


def reset(storm: Storm, fault: Fault) -> None:
    """An operator ends the episode."""
    _request(storm, Control(verb="reset"))


def begin(storm: Storm, fault: Fault) -> None:
    """An operator begins another run."""
    _request(storm, Control(verb="begin", seed=fault.number))


def _request(storm: Storm, *requests: Control) -> None:
    for request in requests:
        storm.operator.deliver("event", Event("request", request))


def _freeze(storm: Storm, process: Process, seconds: float) -> None:
    if not process.dead:
        process.frozen = True
        storm.system.timeline.after(seconds, process.thaw)


ACTS: dict[str, Callable[..., None]] = {
    act.__name__: act
    for act in (kill, restarts, freeze, hang, lose, swap, part, full, stray, pause, speed, reset, begin)
}
"""By the first word of a fault's kind; the words that follow are given to it."""


def lasts(fault: Fault) -> float:
    """Seconds after which nothing of a fault is left."""
    if fault.kind.startswith("restarts"):
        return fault.number * BACK_AFTER_S * (1 + fault.seconds)
    return HANGS_FOR_S if fault.kind.startswith("hang") else fault.seconds
