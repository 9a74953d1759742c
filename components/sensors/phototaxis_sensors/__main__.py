"""`phototaxis sensors`: the sensor suite as a process."""

from collections.abc import Sequence

from phototaxis.runtime.component import ComponentOptions, entry, run
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.options import parse_groups


def main(argv: Sequence[str] | None = None) -> None:
    groups = {"": ComponentOptions, "sensor models": FmuOptions}
    options, models = parse_groups(groups, argv, "phototaxis sensors", "Run the robot's sonars, lights and bumpers.")
    from phototaxis_sensors.choice import choose_sensors
    from phototaxis_sensors.server import serve

    with choose_sensors(models, one_cpu=True) as make:
        run("sensors", options, lambda bus: serve(bus, make))


if __name__ == "__main__":
    entry(main)
