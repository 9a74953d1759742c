"""The house rules that a reader relies on."""

import ast
from pathlib import Path

import pytest
from phototaxis.topics import ROLES, TOPICS, table
from phototaxis_launcher.cli import VERBS

ROOT = Path(__file__).parents[2]
COMPONENTS = {folder.name: folder for folder in (ROOT / "components").iterdir() if folder.is_dir()}
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


@pytest.mark.parametrize("name", COMPONENTS)
def test_no_component_imports_another(name):
    for file in COMPONENTS[name].rglob("*.py"):
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
