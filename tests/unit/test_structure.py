"""The house rules that a reader relies on."""

import ast
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from phototaxis.runtime.roles import COMPONENTS, ROLES
from phototaxis.wire.topics import TOPICS, table
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
    "launcher": {"agent"},  # it checks an agent's options before it starts anything
    "gym": {"sim", "sensors"},  # a world in one process
    "lab": {"sim", "sensors", "agent"},  # its purpose is to put them into one process
}
EXTRAS = PROJECT["project"]["optional-dependencies"]
BESIDE = {
    "contract": {"psutil"},  # who holds a port is told where it is there
    "fmu": {"lxml"},  # fmpy brings it
    "gym": {"stable-baselines3"},  # whoever has a policy of it has it
    "lab": {"distributed"},  # the extra cluster
    "launcher": {"trustme"},  # the extra certs
}
"""What is imported only where it is there, or where an extra of its own was asked for."""


def imported(room: str) -> set[str]:
    """The packages that a room imports at any place, also by their names in quotes."""
    found = []
    for node in (node for file in ROOMS[room].rglob("*.py") for node in ast.walk(ast.parse(file.read_text()))):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.append(node.module)
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "import_module":
            found += [word.value for word in node.args if isinstance(word, ast.Constant)]
    return {module.split(".")[0] for module in found}


@pytest.mark.parametrize("name", ROOMS)
def test_no_component_imports_another(name):
    others = {package.removeprefix("phototaxis_") for package in imported(name) if package.startswith("phototaxis_")}
    assert others <= {name, *ALLOWED[name]}


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_imports_only_what_the_base_and_its_own_extra_bring(name):
    brought = required(PROJECT["project"]["dependencies"]) | required(EXTRAS.get(name, [])) | BESIDE.get(name, set())
    distributions = packages_distributions()
    for package in imported(name) - sys.stdlib_module_names:
        if not package.startswith("phototaxis"):
            assert brought & {canonicalize_name(one) for one in distributions[package]}, package


def required(lines: list[str]) -> set[str]:
    """The distributions that lines of pyproject.toml name, also through our own extras."""
    found = [Requirement(line) for line in lines]
    ours = [required(EXTRAS[extra]) for one in found if one.name == "phototaxis" for extra in one.extras]
    return {canonicalize_name(one.name) for one in found}.union(*ours)


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_has_one_name(name):
    package = f"phototaxis{'' if name == 'contract' else f'_{name}'}"
    assert [path.name for path in ROOMS[name].iterdir()] == [package], "its folder holds its package alone"
    assert f"components/{name}/{package}" in PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert f"components/{name}" in PROJECT["tool"]["pyright"]["extraPaths"]
    assert name == "contract" or name in EXTRAS


@pytest.mark.parametrize("name", ROOMS)
def test_a_rooms_types_are_there_for_whoever_imports_it(name):
    (package,) = ROOMS[name].iterdir()
    assert (package / "py.typed").is_file()


def test_what_is_listed_of_rooms_exists():
    assert len(PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]) == len(ROOMS)
    assert len(PROJECT["tool"]["pyright"]["extraPaths"]) == len(ROOMS)
    assert ALLOWED.keys() == ROOMS.keys()


def test_a_subcommand_of_a_rooms_name_is_in_that_room():
    for verb, found in VERBS.items():
        assert verb not in ROOMS or (found.target.startswith(f"phototaxis_{verb}.") and found.extra == verb)
        assert found.extra in EXTRAS


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
