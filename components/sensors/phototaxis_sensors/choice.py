"""Which sensor models a suite is made of: the built-in ones, or those that an installed package provides."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from importlib.metadata import entry_points
from typing import Any, Protocol

from phototaxis.geometry.arena import Arena
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.phrases import known
from phototaxis.wire.messages import World

from phototaxis_sensors.batch_sensors import BatchSensors
from phototaxis_sensors.batch_suite import BatchSuite
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.suite import Models, SensorSuite, Suite, built_in

GROUP = "phototaxis.sensors"
"""Entry points of packages that provide sensor models."""


class SensorFactory(Protocol):
    """Makes the sensors of one robot, or of many."""

    stateful: bool
    """Whether many robots must all be in the same tick of their episodes."""

    def __call__(self, arena: Arena, scene: Scene) -> Models: ...
    def batch(self, world: World, count: int) -> BatchSuite:
        """The sensors of `count` robots."""
        ...


class BuiltInFactory:
    """The built-in models."""

    stateful = False

    def __call__(self, arena: Arena, scene: Scene) -> Models:
        return built_in(arena, scene)

    def batch(self, world: World, count: int) -> BatchSuite:
        """The sensors of any number of robots."""
        return BatchSuite(world)


class Provided(SensorFactory, Protocol):
    """The sensors of a provider, which hold processes or other things of the machine until they are closed."""

    def try_out(self) -> None:
        """Load the models that the options name before the run begins; `UserError` if that fails."""
        ...

    def close(self) -> None: ...


def make_suite(choice: SensorFactory, world: World) -> Suite[Any, Any]:
    """The suite of a world.

    Raises
    ------
    UserError
        when the models remember and there are many robots, whose episodes begin at different ticks.
    """
    if world.robots == 1:
        return SensorSuite(world, choice)
    if choice.stateful:
        raise UserError(f"an FMU senses for one robot; this world has {world.robots}: start it without --robots")
    return BatchSensors(choice.batch(world, world.robots), world.robots)


@contextmanager
def choose_sensors(options: FmuOptions, one_cpu: bool = False) -> Iterator[SensorFactory]:
    """The built-in models, or FMUs, each of which is loaded once to see that it works.

    With `one_cpu` the thread that uses FMUs stays on one CPU with them, which makes them three times as fast.

    Raises
    ------
    UserError
        when an FMU cannot be used, an option does not fit it, or what runs FMUs is not installed.
    """
    if options == FmuOptions():
        yield BuiltInFactory()
        return
    with closing(provider("fmu")(options, one_cpu)) as models:
        models.try_out()
        yield models


def provider(name: str) -> Callable[[FmuOptions, bool], Provided]:
    """What makes the sensor models of an installed package, by the name of its entry point.

    Raises
    ------
    UserError
        when no such package is installed, or one that it needs is missing.
    """
    points = {point.name: point for point in entry_points(group=GROUP)}
    if name not in points:
        raise UserError(f"no installed package provides sensor models of the kind '{name}'; {known(name, points)}")
    try:
        return points[name].load()
    except ModuleNotFoundError as error:
        raise UserError(
            f"sensor models of the kind '{name}' need the package {error.name}; install it with: "
            f"pip install 'phototaxis[{name}]'"
        ) from None
