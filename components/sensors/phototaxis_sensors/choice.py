"""Which sensor models a suite is made of."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from phototaxis.arena import Arena
from phototaxis.errors import UserError
from phototaxis.fmu import FmuOptions
from phototaxis.messages import World

from phototaxis_sensors.crowd import CrowdSuite
from phototaxis_sensors.many import SuiteOfMany
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.suite import Models, SensorSuite, Suite, built_in


class Choice(Protocol):
    """Makes the sensors of one robot, or of many."""

    remembers: bool
    """Whether many robots must all be in the same tick of their episodes."""

    def __call__(self, arena: Arena, scene: Scene) -> Models: ...
    def crowd(self, world: World, count: int) -> CrowdSuite:
        """The sensors of `count` robots."""
        ...


class BuiltInChoice:
    """The built-in models."""

    remembers = False

    def __call__(self, arena: Arena, scene: Scene) -> Models:
        return built_in(arena, scene)

    def crowd(self, world: World, count: int) -> CrowdSuite:
        """The sensors of any number of robots."""
        return CrowdSuite(world)


def make_suite(choice: Choice, world: World) -> Suite[Any, Any]:
    """The suite of a world.

    Raises
    ------
    UserError
        when the models remember and there are many robots, whose episodes begin at different ticks.
    """
    if world.robots == 1:
        return SensorSuite(world, choice)
    if choice.remembers:
        raise UserError(f"an FMU senses for one robot; this world has {world.robots}: start it without --robots")
    return SuiteOfMany(choice.crowd(world, world.robots), world.robots)


@contextmanager
def choose(options: FmuOptions, one_cpu: bool = False) -> Iterator[Choice]:
    """The built-in models, or FMUs, each of which is loaded once to see that it works.

    With `one_cpu` the thread that uses FMUs stays on one CPU with them, which makes them three times as fast.

    Raises
    ------
    UserError
        when an FMU cannot be used, an option does not fit it, or fmpy is not installed.
    """
    if options == FmuOptions():
        yield BuiltInChoice()
        return
    try:
        from phototaxis_sensors.fmu.sensors import FmuSensors
    except ModuleNotFoundError as error:
        line = f"an FMU needs the package {error.name}; install it with: pip install 'phototaxis[sensors,fmu]'"
        raise UserError(line) from None
    models = FmuSensors(options, one_cpu)
    models.try_out()
    try:
        yield models
    finally:
        models.close()
