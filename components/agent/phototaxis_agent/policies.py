"""Loads frozen policies from files, which drive instead of a learner; the file's suffix selects the loader."""

from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from phototaxis.runtime.errors import UserError

from phototaxis_agent.learner import POLICY_GROUP, load_point


def is_policy(file: Path) -> bool:
    """Whether there is an entry point that is called as the file's suffix."""
    return bool(entry_points(group=POLICY_GROUP, name=file.suffix.removeprefix(".")))


def load_policy(file: Path, trusted: bool, normalize: str = "") -> Any:
    """What makes agents of a policy file: called with a world and `max_episode_steps` it makes one,
    and `batch(arena)` drives many robots.

    `normalize` names the file with the statistics of the observations, if there is one.

    Raises
    ------
    UserError
        when nothing reads such files, what it needs is not installed, or a file cannot be loaded.
    """
    points = {point.name: point for point in entry_points(group=POLICY_GROUP)}
    point = points.get(file.suffix.removeprefix("."))
    if point is None:
        kinds = ", ".join(f".{name}" for name in points)
        raise UserError(f"--policy {file}: no policies of the kind '{file.suffix}'; there are: {kinds}")
    kind = load_point(point, f"--policy {file}: what reads it")
    return kind(file, trusted, Path(normalize)) if normalize else kind(file, trusted)
