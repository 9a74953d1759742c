"""`phototaxis sensors`: the sensor suite as a process."""

from collections.abc import Sequence

from phototaxis.component import ComponentOptions, entry, run
from phototaxis.options import parse


def main(argv: Sequence[str] | None = None) -> None:
    options = parse(ComponentOptions, argv, "phototaxis sensors", "Run the robot's sonars, lights and bumpers.")
    from phototaxis_sensors.server import Server

    run("sensors", options, lambda bus: Server(bus).serve())


if __name__ == "__main__":
    entry(main)
