"""FMUs as sensor models: equal laws, wiring, units, parameters, resets; no bus."""

import math
import random
from pathlib import Path

import msgspec
import numpy as np
import psutil
import pytest
from fmpy.validation import validate_fmu
from fmus import KNOWN, Built, described, edited
from phototaxis.geometry.arena import Arena, Light
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.wire.messages import World
from phototaxis_fmu.description import read
from phototaxis_fmu.sensors import FmuSensors
from phototaxis_fmu.wiring import SUITES, connect
from phototaxis_sensors.batch_suite import BatchSuite
from phototaxis_sensors.model import PastMoment
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.suite import SensorSuite, built_in
from phototaxis_sim.simulation import Simulation

VERSIONS = pytest.mark.parametrize("version", [2, 3])


def drive(count: int, episode: int = 50, seed: int = 0) -> list[PastMoment]:
    """A robot that is everywhere."""
    chance = random.Random(seed)
    where = [(chance.uniform(0.3, 9.7), chance.uniform(0.3, 9.7), chance.uniform(-4, 4)) for _ in range(count)]
    return [PastMoment(tick, tick // episode, *pose) for tick, pose in enumerate(where)]


@pytest.fixture
def sensors():
    """Makes FMU sensors that end with the test."""
    made = []

    def make(**options) -> FmuSensors:
        made.append(FmuSensors(FmuOptions(**options)))
        return made[-1]

    yield make
    for one in made:
        one.close()


@VERSIONS
@pytest.mark.parametrize("name", KNOWN)
def test_the_examples_are_valid(fmu: Built, name, version):
    assert validate_fmu(str(fmu(name, version))) == []


@VERSIONS
@pytest.mark.parametrize("law", ["inverse-square", "linear"])
def test_the_built_in_law_as_an_fmu_gives_the_same_readings(fmu: Built, paper: Arena, sensors, version, law):
    sensing = msgspec.structs.replace(paper.sensing, light_law=law, light_range=6.0)
    arena = msgspec.structs.replace(paper, sensing=sensing, lights=[Light((5, 5)), Light((2, 8), brightness=0.7)])
    words = [f"range={6.0 if law == 'linear' else 0.0}"]
    model = sensors(light_fmu=str(fmu("light", version)), fmu_param=words)(arena, Scene(arena)).light
    ours = built_in(arena, Scene(arena)).light
    worst = max(abs(a - b) for moment in drive(10_000) for a, b in zip(model(moment), ours(moment), strict=True))
    assert worst <= 1e-12


@VERSIONS
def test_a_lag_follows_as_its_differential_equation_says(fmu: Built, paper: Arena, sensors, version):
    model = sensors(light_fmu=str(fmu("lag", version)), fmu_param=["tau=0.4"])(paper, Scene(paper)).light
    ours = built_in(paper, Scene(paper)).light
    state, episode, follow = (0.0, 0.0), -1, 1 - math.exp(-paper.motion.control_period / 0.4)
    for moment in drive(300):
        now = ours(moment)
        if moment.episode != episode:
            state, episode = tuple(now), moment.episode
        state = tuple(was + follow * (new - was) for was, new in zip(state, now, strict=True))
        assert model(moment) == pytest.approx(state, abs=1e-12)


@VERSIONS
def test_sixteen_beams_in_one_instance_or_one_in_each(fmu: Built, paper: Arena, sensors, version):
    ours = built_in(paper, Scene(paper)).sonar
    coarse = sensors(sonar_fmu=str(fmu("sonar", version)), fmu_param=["resolution=0.25"])(paper, Scene(paper)).sonar
    plain = sensors(sonar_fmu=str(fmu("faulty", version)), fmu_param=["at=1000"])
    for moment in drive(100):
        ranges = ours(moment)
        expected = [max(0.1, 0.25 * math.floor(distance / 0.25 + 0.5)) for distance in ranges]
        assert coarse(moment) == pytest.approx(expected, abs=1e-12)
    one_each = plain(paper, Scene(paper)).sonar
    near = [moment for moment in drive(400) if max(ours(moment)) < 5]
    for tick, moment in enumerate(near):
        now = PastMoment(tick, 0, moment.x, moment.y, moment.heading)
        assert one_each(now) == pytest.approx(ours(moment), abs=1e-12)


@VERSIONS
def test_many_robots_have_their_own_instances(fmu: Built, paper: Arena, sensors, version):
    quiet = msgspec.structs.replace(paper, sensing=msgspec.structs.replace(paper.sensing, noise=0.0))
    world = World(run="w", arena=quiet, seed=3, epochs=0)
    ours = BatchSuite(world)
    poses = np.array([[moment.x, moment.y, moment.heading] for moment in drive(30)])
    for kind, name in (("light", "light"), ("sonar", "sonar")):
        batch = sensors(**{f"{kind}_fmu": str(fmu(name, version))}).batch(world, len(poses))
        for tick in range(3):
            sonar, light = batch(tick, poses)
            expected_sonar, expected_light = ours(tick, poses)
            if kind == "light":
                assert np.abs(light - expected_light).max() < 1e-12
                assert np.array_equal(sonar, expected_sonar)
            else:
                assert np.abs(sonar - expected_sonar).max() <= 0.1
                assert np.array_equal(light, expected_light)
    lag = sensors(light_fmu=str(fmu("lag", version))).batch(world, len(poses))
    single = sensors(light_fmu=str(fmu("lag", version)))(paper, Scene(paper)).light
    for tick in range(5):
        where = np.roll(poses, tick, axis=0)
        both = lag(tick, where)[1][:, 0]
        assert both == pytest.approx(single(PastMoment(tick, 0, *where[0])), abs=1e-9)


def test_names_units_and_parameters(fmu: Built, paper: Arena, sensors, tmp_path: Path):
    other = described(fmu("light", 2), tmp_path / "a.fmu", 'name="distance"', 'name="d"')
    with pytest.raises(UserError, match="has no variable 'x'; its inputs are d, brightness, visibility"):
        sensors(light_fmu=str(other), fmu_map=["distance=x"])
    cm = described(
        other,
        tmp_path / "b.fmu",
        '<Unit name="m">\n      <BaseUnit m="1" />',
        '<Unit name="cm">\n      <BaseUnit m="1" factor="0.01" />',
    )
    cm = described(cm, tmp_path / "c.fmu", 'unit="m"', 'unit="cm"')
    model = sensors(light_fmu=str(cm), fmu_map=["distance=d"])(paper, Scene(paper)).light
    ours = built_in(paper, Scene(paper)).light
    for moment in drive(50):
        far = [min(1.0, reading / 10_000) for reading in ours(moment) if reading < 1]  # 100 times as far
        assert [reading for reading in model(moment) if reading < 1e-4] == pytest.approx(far, rel=1e-9)
    seconds = described(fmu("light", 3), tmp_path / "d.fmu", 'unit="m"', 'unit="s"')
    with pytest.raises(UserError, match="the unit of distance, s, cannot be converted from m"):
        sensors(light_fmu=str(seconds))
    for factor in ("0", "NaN", "INF", "1e-320"):
        odd = described(cm, tmp_path / "e.fmu", 'factor="0.01"', f'factor="{factor}"')
        with pytest.raises(UserError, match="the unit of d, cm, has factor"):
            sensors(light_fmu=str(odd), fmu_map=["distance=d"])
    with pytest.raises(UserError, match="has no parameter 'tau'; its parameters are range"):
        sensors(light_fmu=str(fmu("light", 3)), fmu_param=["tau=1"])
    with pytest.raises(UserError, match=r"--fmu-param half=-1: out of its range 1e-06 to inf"):
        sensors(light_fmu=str(fmu("photodiode", 3)), fmu_param=["half=-1"])
    with pytest.raises(UserError, match="tau is of type Float64"):
        sensors(light_fmu=str(fmu("lag", 3)), fmu_param=["tau=slow"])
    with pytest.raises(UserError, match="expected NAME=VALUE"):
        sensors(light_fmu=str(fmu("lag", 3)), fmu_param=["tau"])
    with pytest.raises(UserError, match="there is no FMU"):
        sensors(fmu_param=["tau=1"])
    both = {"light_fmu": str(fmu("lag", 3)), "sonar_fmu": str(fmu("lag", 2))}
    with pytest.raises(UserError, match=r"for which FMU\? write light.tau=… or sonar.tau=…"):
        sensors(**both, fmu_param=["tau=1"])
    sensors(**both, fmu_param=["light.tau=1", "sonar.tau=2"]).try_out()
    with pytest.raises(UserError, match="the light model has no 'colour', but distance, bearing"):
        sensors(light_fmu=str(fmu("light", 3)), fmu_map=["colour=range"])


def test_another_step_than_the_suggested_one_is_said_once(fmu: Built, paper: Arena, sensors, tmp_path: Path, capsys):
    experiment = '<DefaultExperiment stepSize="0.01" />\n  <ModelVariables>'
    file = described(fmu("lag", 2), tmp_path / "s.fmu", "<ModelVariables>", experiment)
    make = sensors(light_fmu=str(file))
    make.try_out()
    make(paper, Scene(paper))
    line = "light FMU s.fmu suggests steps of 0.01 s; it gets steps of 0.5 s, the control period"
    assert capsys.readouterr().err.count(line) == 1


def test_what_cannot_be_wired(fmu: Built, tmp_path: Path):
    light, sonar = fmu("light", 3), fmu("sonar", 3)
    cases = [
        (light, 'causality="output"', 'causality="local"', "reading has causality local; it must be output"),
        (light, 'causality="input" description="brightness of the lamp"',
         'causality="parameter" variability="fixed" description="x"',
         "brightness has causality parameter; it must be input"),
        (sonar, '<Dimension start="16" />', '<Dimension start="4" />', "range has 4 values; it must have 1 or 16"),
    ]  # fmt: skip
    for number, (source, old, new, line) in enumerate(cases):
        file = described(source, tmp_path / f"{number}.fmu", old, new)
        suite = SUITES["sonar" if source is sonar else "light"]
        with pytest.raises(UserError, match=line):
            connect(read(str(file)), suite, {}, {})
    with pytest.raises(UserError, match="it is not clear which input to use"):
        connect(read(str(fmu("sonar", 2))), SUITES["light"], {}, {})
    integer = edited(light, tmp_path / "i.fmu", _integer_distance)
    with pytest.raises(UserError, match="distance has type Int32; it must be Float64"):
        connect(read(str(integer)), SUITES["light"], {}, {})


def _integer_distance(name: str, data: bytes) -> tuple[str, bytes]:
    if name == "modelDescription.xml":
        one = b'<Float64 name="distance"'
        start, end = data.index(one), data.index(b"/>", data.index(one))
        line = (
            data[start:end]
            .replace(b"Float64", b"Int32")
            .replace(b'start="0.0"', b'start="0"')
            .replace(b' unit="m"', b"")
        )
        data = data[:start] + line + data[end:]
    return name, data


@VERSIONS
def test_ten_thousand_episodes_with_one_load_take_no_more_memory(fmu: Built, paper: Arena, sensors, version):
    model = sensors(light_fmu=str(fmu("lag", version)))(paper, Scene(paper)).light
    host = model._stepped._host
    pid, sizes = host.pid, []
    for episode in range(10_001):
        model(PastMoment(episode, episode, 3, 3, 0))
        if episode in (1_000, 10_000):
            sizes.append(psutil.Process(pid).memory_info().rss)
    assert host.pid == pid, "loaded once"
    assert sizes[1] - sizes[0] < 500_000


@VERSIONS
def test_an_fmu_that_a_process_can_have_once_has_a_process_for_each_sensor(
    fmu: Built, paper: Arena, sensors, tmp_path, version
):
    flag = 'canBeInstantiatedOnlyOncePerProcess="true" '
    once = described(fmu("lag", version), tmp_path / "o.fmu", "canHandle", flag + "canHandle")
    alone = sensors(light_fmu=str(once))(paper, Scene(paper)).light
    together = sensors(light_fmu=str(fmu("lag", version)))(paper, Scene(paper)).light
    for moment in drive(60, episode=20):
        assert alone(moment) == together(moment)
    assert sum("fmu.worker" in " ".join(child.cmdline()) for child in psutil.Process().children()) == 3


def test_a_suite_with_an_fmu_repeats_itself(fmu: Built, paper: Arena, sensors):
    make = sensors(light_fmu=str(fmu("lag", 3)))
    runs = []
    for _ in range(2):
        simulation = Simulation(paper, 4, "r")
        suite = SensorSuite(simulation.world, make)
        readings = []
        for step in range(120):
            readings.append(suite(simulation.state))
            simulation.advance(1.0, 0.3, "a", "truncated" if step % 40 == 39 else "")
        runs.append(readings)
    assert runs[0] == runs[1]
