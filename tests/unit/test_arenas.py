"""Arenas: the shipped ones are worlds, a wrong file gets one line that names the key."""

import math
from codecs import BOM_UTF8

import numpy as np
import pytest
from phototaxis.errors import UserError
from phototaxis_sim import arenas
from phototaxis_sim.physics import Physics

HEAD = 'name = "t"\nsize = [10.0, 10.0]\n'
LIGHT = "[[lights]]\nposition = [5.0, 5.0]\n"


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
        (HEAD + LIGHT + "[robot]\nlength = -1.0\n", ["robot.length", "expected a number above 0"]),
        (HEAD + LIGHT + '[motion]\ncollision = "bounce"\n', ["motion.collision", "'bounce' is not one of the choices"]),
        (HEAD + LIGHT + "[motion]\nphysics_step = 0.3\n", ["motion.physics_step", "whole fraction"]),
        (HEAD + "[[lights]]\nposition = [50.0, 5.0]\n", ["lights[0].position", "inside the room"]),
        (HEAD + LIGHT + "[[polygons]]\ncorners = [[0,0],[2,0],[1,0.5],[2,2]]\n", ["polygons[0].corners", "convex"]),
        (HEAD + LIGHT + "x = = 3\n", ["not TOML"]),
    ],
)
def test_a_wrong_file_is_told_in_one_line(text, words):
    with pytest.raises(UserError) as error:
        arenas.parse(text, "t.toml")
    line = str(error.value)
    assert "\n" not in line
    for word in words:
        assert word in line


def test_a_robot_that_fits_nowhere_is_told():
    arena = arenas.parse(HEAD + LIGHT + "[robot]\nlength = 11.0\nwidth = 11.0\n", "t.toml")
    with pytest.raises(UserError, match="fits nowhere"):
        Physics(arena).random_pose(np.random.default_rng(0))


def test_a_file_with_a_byte_order_mark_is_an_arena(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_bytes(BOM_UTF8 + (HEAD + LIGHT).encode())
    assert arenas.load(str(file)).name == "t"


def test_an_unknown_name_lists_what_there_is():
    with pytest.raises(UserError, match=r"no arena 'mars'.*doorway.*paper"):
        arenas.load("mars")
