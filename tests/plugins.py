"""Learners as other people's distributions, made for a test."""

from pathlib import Path

HEAD = """
import msgspec
from phototaxis_agent.learner import Learner


class Fine(Learner):
    class Options(msgspec.Struct, frozen=True):
        rate: float = 0.1
        centred: bool = True

    def __init__(self, options, percept, rng):
        self._count = len(percept.actions)

    def values(self, state):
        return [0.0] * self._count

    def learn(self, transition):
        return 0.0

    def save(self):
        return {}

    def load(self, arrays):
        pass
"""


def install(folder: Path, name: str, code: str, target: str = "Fine") -> str:
    """Write the module NAME_plugin with the learner NAME into a folder that is on the path; the module's name."""
    module = f"{name}_plugin"
    (folder / f"{module}.py").write_text(HEAD + code, "utf-8")
    about = folder / f"{name}-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
    (about / "entry_points.txt").write_text(f"[phototaxis.learners]\n{name} = {module}:{target}\n")
    return module
