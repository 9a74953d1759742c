"""Measures the steps/s of aitk.robots, a successor of the paper's simulator, with sensors like ours, for `make bench`.

Install aitk.robots in an environment of its own, since it installs TensorFlow, and name its Python in AITK_PYTHON.
One step is one time step of its world and one reading of all sensors; one of our steps is a control period of five
physics steps and the same readings.
"""

import random
import time

from aitk.robots import LightSensor, RangeSensor, Scribbler, World  # pyright: ignore[reportMissingImports] - installed by hand

STEPS = 1000


def main() -> None:
    world = World(width=500, height=500, quiet=True)
    world.add_bulb("yellow", 250, 250, 0, 75.0)
    robot = Scribbler(x=100, y=100)
    rangers = [RangeSensor(position=(8, 0), a=22.5 * number, max=200, name=f"sonar{number}") for number in range(16)]
    lights = [LightSensor(position=(10, side), name=f"light{side}") for side in (5, -5)]
    for device in (*rangers, *lights):
        robot.add_device(device)
    world.add_robot(robot)
    world.reset()
    chance = random.Random(0)  # noqa: S311 - a drive, no secret
    began = time.perf_counter()
    for _ in range(STEPS):
        robot.move(chance.choice([-1, 0, 1]), chance.choice([-1, 0, 1]))
        world._step(show=False, real_time=False)
        for ranger in rangers:
            ranger.get_distance()
        for light in lights:
            light.get_brightness()
    print(STEPS / (time.perf_counter() - began))


if __name__ == "__main__":
    main()
