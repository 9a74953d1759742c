"""The house rules that a reader relies on."""

import ast
import tomllib
from pathlib import Path

import pytest
import yaml
from phototaxis.roles import COMPONENTS, ROLES
from phototaxis.topics import TOPICS, table
from phototaxis_launcher.cli import VERBS

ROOT = Path(__file__).parents[2]
ROOMS = {folder.name: folder for folder in (ROOT / "components").iterdir() if folder.is_dir()}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
COMPOSE = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())["services"]
ALLOWED = {
    "contract": set(),
    "world": set(),
    "sim": {"world"},  # a library, no process
    "sensors": {"world"},
    "fmu": {"sensors"},  # it provides models for the sensors, as a learner does for the agent
    "agent": set(),
    "recorder": set(),
    "launcher": set(),
    "gym": {"sim", "sensors"},  # a world in one process
    "lab": {"sim", "sensors", "agent"},  # its purpose is to put them into one process
}


@pytest.mark.parametrize("name", ROOMS)
def test_no_component_imports_another(name):
    for file in ROOMS[name].rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            modules = []
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                modules = [node.module]
            for module in modules:
                top = module.split(".")[0]
                if top.startswith("phototaxis_"):
                    other = top.removeprefix("phototaxis_")
                    assert other == name or other in ALLOWED[name], f"{file} imports {module}"


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_has_one_name(name):
    package = f"phototaxis{'' if name == 'contract' else f'_{name}'}"
    assert [path.name for path in ROOMS[name].iterdir()] == [package], "its folder holds its package alone"
    assert f"components/{name}/{package}" in PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert f"components/{name}" in PROJECT["tool"]["pyright"]["extraPaths"]
    assert name == "contract" or name in PROJECT["project"]["optional-dependencies"]


def test_what_is_listed_of_rooms_exists():
    assert len(PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]) == len(ROOMS)
    assert len(PROJECT["tool"]["pyright"]["extraPaths"]) == len(ROOMS)
    assert ALLOWED.keys() == ROOMS.keys()


def test_a_subcommand_of_a_rooms_name_is_in_that_room():
    for verb, found in VERBS.items():
        assert verb not in ROOMS or (found.target.startswith(f"phototaxis_{verb}.") and found.extra == verb)
        assert found.extra in PROJECT["project"]["optional-dependencies"]


@pytest.mark.parametrize("name", COMPONENTS)
def test_a_component_is_a_room_a_subcommand_and_a_service_of_one_name(name):
    role, service = COMPONENTS[name], COMPOSE[name]
    assert VERBS[name] == (f"phototaxis_{name}.__main__:main", name, role.about)
    assert (ROOMS[name] / f"phototaxis_{name}" / "__main__.py").is_file()
    assert service["image"].startswith(f"phototaxis-{name}:")
    assert service["build"]["args"]["COMPONENT"] == name
    assert f"exec phototaxis {name} " in service["command"][0]
    assert f"exec phototaxis health {name} " in service["healthcheck"]["test"]
    assert service["stop_grace_period"] == f"{role.ends_within_s:g}s"


def test_every_service_is_the_router_or_a_component():
    assert {name.split("-")[0] for name in COMPOSE} == {"router", *COMPONENTS}


def test_each_topic_has_one_writer_that_exists_and_readers_that_exist():
    for topic in TOPICS.values():
        assert topic.writer in ROLES
    for role in ROLES.values():
        assert set(role.reads) <= set(TOPICS)
        assert all(ROLES[other].listens for other in role.dials)


def test_every_reader_is_linked_to_the_writer_it_reads():
    for name, role in ROLES.items():
        for read in role.reads:
            writer = TOPICS[read].writer
            assert writer in role.dials or name in ROLES[writer].dials, f"{name} reads {read}, not linked to {writer}"


def test_the_recorder_stays_off_the_tick_path():
    assert {TOPICS[name].kind for name in ROLES["recorder"].reads} == {"log"}


def test_the_documented_topics_are_the_real_ones():
    assert table() in (ROOT / "ARCHITECTURE.md").read_text()


def test_the_readme_names_every_command():
    readme = (ROOT / "README.md").read_text()
    for verb in VERBS:
        assert f"phototaxis {verb}" in readme, verb
