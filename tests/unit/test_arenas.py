"""Arenas: the shipped ones are worlds, a wrong file gets one line that names the key."""

import math
from codecs import BOM_UTF8
from importlib import resources

import msgspec
import numpy as np
import pytest
from phototaxis.geometry.arena import Disc, Placement, Sensing
from phototaxis.runtime.errors import UserError
from phototaxis.wire.codec import Decoder, Refused
from phototaxis.wire.messages import World
from phototaxis_sim import arenas
from phototaxis_sim.physics import Physics
from phototaxis_sim.simulation import Simulation
from phototaxis_sim.survey import survey

HEAD = 'name = "t"\nsize = [10.0, 10.0]\n'
LIGHT = "[[lights]]\nposition = [5.0, 5.0]\n"
DIM = "[[lights]]\nposition = [{}, 5]\nbrightness = 0.6\n"
STAR = "corners = [[3, 1], [1, 2.5], [3.5, 2.5], [1.5, 1], [2.3, 3.2]]\n"
LOWER = "[[polygons]]\ncorners = [[0, 0], [10, 0], [10, 4.95], [0, 4.95]]\n"
BRIGHT = LIGHT + "brightness = 100\n[sensing]\nbody_shadow = false\n"


def walls(*corners: list[float]) -> str:
    """Walls from each corner to the next, and back to the first."""
    pairs = zip(corners, (*corners[1:], corners[0]), strict=True)
    return "".join(f"[[walls]]\nstart = {start}\nend = {end}\n" for start, end in pairs)


def test_five_arenas_are_shipped_and_paper_is_the_papers(paper):
    assert set(arenas.shipped()) == {"paper", "pyro-realtime", "shadows", "doorway", "two-lights"}
    assert paper.size == (10, 10)
    assert paper.lights[0].position == (5, 5)
    assert (paper.physics_steps, paper.sensing.noise, paper.sensing.near) == (5, 0.05, 0.4)


@pytest.mark.parametrize("name", arenas.shipped())
def test_the_robot_finds_free_places_away_from_the_lights(name):
    arena = arenas.load(name)
    physics = Physics(arena)
    rng = np.random.default_rng(0)
    for _ in range(50):
        pose = physics.random_pose(rng)
        assert physics.free(pose)
        assert min(math.dist(pose[:2], light.position) for light in arena.lights) >= 1.5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + LIGHT + "[robot]\nwheels = 3\n", ["t.toml", "robot.wheels", "unknown key"]),
        (HEAD + LIGHT + "gravity = 9.81\n", ["lights[0].gravity", "unknown key"]),
        (HEAD, ["lights", "missing"]),
        (HEAD + "lights = []\n", ["lights", "expected a list of at least 1 entries"]),
        (HEAD + LIGHT + "[[walls]]\nstart = [1.0, 1.0]\nend = [1.0, 1.0]\n", ["walls[0]", "two different points"]),
        (HEAD + LIGHT + "[robot]\nlength = -1.0\n", ["robot.length", "expected a number above 0", "got -1.0"]),
        (HEAD + LIGHT + '[motion]\ncollision = "bounce"\n', ["motion.collision", "'bounce' is not one of the choices"]),
        (HEAD + LIGHT + "[motion]\nphysics_step = 0.3\n", ["motion.physics_step", "whole fraction"]),
        (HEAD + "[[lights]]\nposition = [50.0, 5.0]\n", ["lights[0].position", "inside the room"]),
        (HEAD + LIGHT + "[[polygons]]\ncorners = [[0,0],[2,0],[1,0.5],[2,2]]\n", ["polygons[0].corners", "convex"]),
        (HEAD + LIGHT + "x = = 3\n", ["not TOML"]),
        ('name = "t"\nsize = [nan, 10.0]\n' + LIGHT, ["size[0]", "got nan"]),
        ('name = "t"\nsize = [1e300, 10.0]\n' + LIGHT, ["size[0]", "at most 10000", "got 1e+300"]),
        ('name = "a\\nb"\nsize = [10.0, 10.0]\n' + LIGHT, ["name", "printable"]),
        (HEAD + "[[lights]]\nposition = [nan, 5.0]\n", ["lights[0].position[0]", "got nan"]),
        (HEAD + LIGHT + "[[walls]]\nstart = [0, 1]\nend = [inf, 2]\n", ["walls[0].end[0]", "got inf"]),
        (HEAD + LIGHT + "[[discs]]\ncentre = [2, -inf]\nradius = 1\n", ["discs[0].centre[1]", "got -inf"]),
        (HEAD + LIGHT + "[[polygons]]\ncorners = [[0,0],[2,0],[1,nan]]\n", ["polygons[0].corners[2][1]", "got nan"]),
        (HEAD + LIGHT + "[robot]\nspeed = inf\n", ["robot.speed", "got inf"]),
        (HEAD + LIGHT + "[robot]\nspeed = 9999\n", ["robot.speed", "at most 2.1e+03"]),
        (HEAD + LIGHT + "[motion]\nphysics_step = 5e-324\n", ["motion.physics_step", "at least"]),
        (HEAD + LIGHT + "[[discs]]\ncentre = [2, 2]\nradius = 1e-9\n", ["discs[0]", "0.002 m thick"]),
        (HEAD + LIGHT + "[[polygons]]\ncorners = [[0,0],[2,0],[2,1e-6]]\n", ["polygons[0]", "0.002 m thick"]),
        (HEAD + LIGHT + "[[polygons]]\n" + STAR, ["polygons[0].corners", "convex"]),
        (HEAD + LIGHT + "[[discs]]\ncentre = [5.05, 5]\nradius = 0.2\n", ["lights[0].position", "inside discs[0]"]),
        (HEAD + LIGHT + "[[walls]]\nstart = [0, 5]\nend = [10, 5]\nthickness = 0.5\n", ["inside walls[0]"]),
        (HEAD + LIGHT + "[[polygons]]\ncorners = [[4,4],[6,4],[5,7]]\n", ["inside polygons[0]"]),
        (HEAD + LIGHT + "[placement]\nlight_distance = 8\n", ["placement.light_distance", "lights[0]", "at most 7.07"]),
        (HEAD + LIGHT + "[placement]\nclearance = 4.9\n", ["placement.clearance", "fits nowhere"]),
        (HEAD + LIGHT + "[robot]\nlength = 11.0\nwidth = 11.0\n", ["robot.length", "fits nowhere"]),
        (HEAD + LIGHT + "[robot]\nlength = 1e-6\n", ["robot.length", "at least 0.01 m"]),
        (HEAD + LIGHT + "[robot]\nsonar_range = 0.3\n", ["sensing.near", "robot.sonar_range"]),
        (HEAD + LIGHT + "[robot]\nlight_sensors = [[99, 0], [0, 0]]\n", ["robot.light_sensors[0]", "outside a room"]),
    ],
)
def test_a_wrong_file_is_told_in_one_line(text, words):
    with pytest.raises(UserError) as error:
        arenas.parse(text, "t.toml")
    line = str(error.value)
    assert "\n" not in line
    for word in words:
        assert word in line


def test_a_message_with_no_world_in_it_is_refused_at_every_door(paper):
    world = msgspec.to_builtins(World(run="r", arena=paper, seed=0, epochs=0))
    decode = Decoder(World, 1_000_000)
    assert decode(msgspec.msgpack.encode(world)).arena == paper
    world["arena"]["walls"] = [{"start": [math.nan, 1.0], "end": [2.0, 2.0]}]
    with pytest.raises(Refused, match="invalid"):
        decode(msgspec.msgpack.encode(world))
    world["arena"]["walls"] = [{"start": [1.0, 5.0], "end": [9.0, 5.0], "thickness": 1.0}]
    for encode in (msgspec.msgpack.encode, msgspec.json.encode):
        with pytest.raises(Refused, match=r"lights\[0\].position: .* inside walls\[0\]"):
            decode(encode(world))
    with pytest.raises(ValueError, match="lights"):  # nor can a program make one
        msgspec.structs.replace(paper, discs=[Disc((5.0, 5.0), 1.0)])


def test_two_dim_lights_make_a_bright_place(enter):
    enter(HEAD + DIM.format(5) + DIM.format(5.5))
    with pytest.raises(UserError, match=r"t.toml: lights\[0\].brightness: no sensor can ever read"):
        enter(HEAD + DIM.format(1) + DIM.format(9))
    with pytest.raises(UserError, match=r"more than 0.945, .* above 0.95"):
        enter(HEAD + LIGHT + "brightness = 0.9\n")


def test_where_episodes_end_by_themselves_a_dim_light_is_a_warning(enter, monkeypatch, capsys):
    monkeypatch.setattr("phototaxis.runtime.errors._said", set())
    with pytest.raises(UserError):
        enter(HEAD + LIGHT + "brightness = 0.1\n")
    assert arenas.load_checked("t.toml", goal=False).lights[0].brightness == 0.1
    assert "lights[0].brightness: no sensor can ever read" in capsys.readouterr().err


@pytest.fixture
def enter(tmp_path, capsys, monkeypatch):
    """Enters an arena given as a text; what it says on stderr."""
    monkeypatch.chdir(tmp_path)

    def do(text: str) -> str:
        (tmp_path / "t.toml").write_text(text)
        arenas.load_checked("t.toml")
        return capsys.readouterr().err

    return do


@pytest.mark.parametrize("name", arenas.shipped())
def test_nothing_is_suspicious_about_what_is_shipped(name, enter, paper):
    assert survey(arenas.load(name)) == []
    text = resources.files("phototaxis_sim").joinpath("arenas", f"{name}.toml").read_text()
    assert enter(text) == ""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + LIGHT + walls([4, 4], [6, 4], [6, 6], [4, 6]), ["lights", "from any placement", "no way"]),
        (HEAD + LIGHT + "[[walls]]\nstart = [7.5, 0]\nend = [7.5, 10]\n", ["% of the placements", "no way"]),
        (HEAD + LIGHT + "brightness = 20\n", ["% of the placements", "before the first step"]),
        (HEAD + LIGHT + "[[discs]]\ncentre = [20, 5]\nradius = 1\n", ["discs[0]", "outside the room"]),
        (HEAD + LIGHT + "[robot]\nlight_sensors = [[1, 0], [0, 0]]\n", ["robot.light_sensors[0]", "outside the robot"]),
        ('name = "paper"\nsize = [12.0, 10.0]\n' + LIGHT, ["name", "shipped", "another world"]),
    ],
)
def test_what_is_suspicious_is_one_warning(enter, monkeypatch, text, words):
    monkeypatch.setattr("phototaxis.runtime.errors._said", set())
    said = enter(text)
    assert said.startswith("phototaxis: warning: t.toml: ")
    assert said.count("\n") == 1
    for word in words:
        assert word in said
    assert enter(text) == ""


def test_a_gap_that_lets_the_robot_through_is_none_to_warn_of(enter):
    gap = "[[walls]]\nstart = [7, 0]\nend = [7, 4.6]\n[[walls]]\nstart = [7, 5.2]\nend = [7, 10]\n"
    assert enter(HEAD + LIGHT + gap) == ""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + BRIGHT, "placement.light_distance: the light is reached already"),
        (HEAD + LIGHT + "[placement]\nclearance = 3.9\n", "fits nowhere"),
        (HEAD + LIGHT + "[[polygons]]\ncorners = [[0, 5.05], [10, 5.05], [10, 10], [0, 10]]\n" + LOWER, "fits nowhere"),
    ],
)
def test_a_world_in_which_no_episode_could_be_is_refused(enter, text, words):
    with pytest.raises(UserError, match=words) as error:
        enter(text)
    assert str(error.value).startswith("t.toml: ")
    assert "\n" not in str(error.value)


def test_episodes_that_end_before_they_begin_do_not_go_on_for_ever(paper):
    simulation = Simulation(paper, 0, "r")
    for _ in range(999):
        simulation.advance(0.0, 0.0, "a", "terminated")
    with pytest.raises(UserError, match=r"1000 episodes.*placement.light_distance"):
        simulation.advance(0.0, 0.0, "a", "terminated")
    again = Simulation(paper, 0, "r")
    for _ in range(1001):
        again.advance(0.0, 0.0, "a")
        again.advance(0.0, 0.0, "a", "terminated")


def test_a_digest_is_of_the_world_and_not_of_its_name(paper):
    renamed = msgspec.structs.replace(paper, name="mine", about="")
    assert renamed.digest == paper.digest
    for other in ({"size": (10.0, 10.5)}, {"placement": Placement(2.0)}, {"sensing": Sensing(noise=0.1)}):
        assert msgspec.structs.replace(paper, **other).digest != paper.digest


def test_a_file_with_a_byte_order_mark_is_an_arena(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_bytes(BOM_UTF8 + (HEAD + LIGHT).encode())
    assert arenas.load(str(file)).name == "t"


def test_an_unknown_name_lists_what_there_is():
    with pytest.raises(UserError, match=r"no arena 'mars'.*doorway.*paper"):
        arenas.load("mars")
