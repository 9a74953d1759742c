"""Sensors: geometry that can be checked by hand, and purity."""

import math
from importlib.metadata import Distribution
from pathlib import Path

import msgspec
import pytest
from phototaxis.geometry.arena import Arena, Light, Wall
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.wire.messages import World
from phototaxis_sensors import choice
from phototaxis_sensors.noise import uniform
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim.physics import Pose
from phototaxis_sim.simulation import Simulation


def sense(arena: Arena, pose: tuple[float, float, float], noise: float = 0.0, tick: int = 0):
    arena = msgspec.structs.replace(arena, sensing=msgspec.structs.replace(arena.sensing, noise=noise))
    state = Simulation(arena, 0, "r").state
    state.x, state.y, state.heading = Pose(*pose)
    state.tick = tick
    return SensorSuite(World(run="r", arena=arena, seed=5, epochs=0))(state)


def test_sonars_measure_to_the_walls(paper: Arena):
    found = sense(paper, (3, 5, 0)).sonar
    assert found[0] == found[15] == pytest.approx(5 - 0.175)
    assert found[7] == found[8] == pytest.approx(5 - 0.175)
    assert found[3] == pytest.approx((7 - 0.225) / math.cos(math.radians(15)))
    assert found[11] == pytest.approx((3 - 0.225) / math.cos(math.radians(15)))
    assert found[3] == pytest.approx(found[4])


def test_sonars_see_no_farther_than_their_range(paper: Arena):
    assert sense(paper, (1, 5, 0)).sonar[3] == 8


def test_a_sonar_pressed_into_a_wall_reads_zero(paper: Arena):
    assert sense(paper, (9.80, 5, 0)).sonar[3] == 0


def test_light_falls_with_the_square_of_the_distance(paper: Arena):
    left, right = sense(paper, (5 - 0.225 - 2, 5, 0)).light
    assert left == right == pytest.approx(1 / (4 + 0.175**2))
    assert sense(paper, (5 - 0.225 - 0.9, 5, 0)).light[0] == 1


def test_the_body_hides_the_light_behind_it(paper: Arena):
    assert sense(paper, (3, 5, math.pi)).light == (0, 0)
    left, right = sense(paper, (3, 5, math.pi / 2)).light  # the light is to the right
    assert left == 0
    assert right > 0.2


def test_a_wall_hides_the_light(paper: Arena):
    walled = msgspec.structs.replace(paper, walls=[Wall((4, 4), (4, 6))])
    assert sense(walled, (3, 5, 0)).light == (0, 0)


def test_two_lights_add_up_and_are_clipped(paper: Arena):
    one = sense(paper, (2, 5, 0)).light[0]
    twice = msgspec.structs.replace(paper, lights=[Light((5, 5)), Light((5, 5))])
    assert sense(twice, (2, 5, 0)).light[0] == pytest.approx(2 * one)
    assert sense(twice, (3.5, 5, 0)).light[0] == 1


def test_noise_is_bounded_seeded_and_pure(paper: Arena):
    pose = (2.5, 5, 0.1)
    clean, noisy = sense(paper, pose), sense(paper, pose, noise=0.05, tick=9)
    assert noisy == msgspec.structs.replace(sense(paper, pose, noise=0.05, tick=9))
    assert noisy.sonar != sense(paper, pose, noise=0.05, tick=10).sonar
    for a, b in zip(clean.sonar, noisy.sonar, strict=True):
        assert a * 0.95 <= b <= a * 1.05


def test_noise_does_not_change_between_versions():
    assert uniform(5, 9, 3).tolist() == [-0.17511927406481398, -0.4168019287808895, 0.8176970485523911]
    sample = uniform(1, 2, 10_000)
    assert abs(sample.mean()) < 0.02
    assert -1 <= sample.min() < -0.99
    assert 0.99 < sample.max() < 1


def test_models_of_an_installed_package_are_found_by_its_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "blind_models.py").write_text(
        "from phototaxis_sensors.choice import BuiltInFactory\n"
        "class Blind(BuiltInFactory):\n"
        "    closed = []\n"
        "    def __init__(self, options, one_cpu): self.file = options.light_fmu\n"
        "    def try_out(self): assert self.file == 'some.fmu'\n"
        "    def close(self): self.closed.append(self)\n"
    )
    about = tmp_path / "blind-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: blind\nVersion: 1\n")
    (about / "entry_points.txt").write_text("[phototaxis.sensors]\nfmu = blind_models:Blind\nbroken = blind_gone:Any\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(choice, "entry_points", lambda group: Distribution.at(about).entry_points.select(group=group))
    with choice.choose_sensors(FmuOptions(light_fmu="some.fmu")) as models:
        assert type(models).__name__ == "Blind"
        closed: list[object] = vars(type(models))["closed"]
        assert not closed
    assert closed == [models]
    with choice.choose_sensors(FmuOptions()) as models:
        assert type(models) is choice.BuiltInFactory
    with pytest.raises(UserError, match=r"'broken' need the package blind_gone; install it .*'phototaxis\[broken\]'"):
        choice.provider("broken")
    with pytest.raises(UserError, match=r"of the kind 'brokn'; did you mean broken\? there are: fmu, b"):
        choice.provider("brokn")
