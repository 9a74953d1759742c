"""From a command line to an agent: the same options over the bus and in one process."""

import sys
from collections.abc import Sequence
from typing import Any

import msgspec
from msgspec import Struct
from phototaxis.checkpoint import Meta
from phototaxis.errors import UserError
from phototaxis.messages import World
from phototaxis.options import convert, parse_groups, peek
from phototaxis.task import TaskOptions

from phototaxis_agent.agent import Agent
from phototaxis_agent.exploration import Exploration
from phototaxis_agent.learner import find


class LearnerOptions(Struct, kw_only=True):
    """Which learner."""

    learner: str = "qtable"
    """name of the learner"""


class Setup(Struct):
    """Everything that defines an agent but the world and the seed."""

    learner: str
    hyperparameters: Any
    task: TaskOptions
    exploration: Exploration

    def agent(
        self, world: World, *, seed: int | None = None, budget: int | None = None, learning: bool = True
    ) -> Agent:
        """An agent for a world; `seed` and `budget` are the world's unless they are given."""
        return Agent(
            self.learner,
            self.hyperparameters,
            self.task,
            self.exploration,
            near=world.arena.sensing.near,
            seed=world.seed if seed is None else seed,
            budget=budget or world.epochs or DEFAULT_BUDGET,
            learning=learning,
            arena=world.arena,
        )


def presets(learner: str, percept: str) -> dict[str, Any]:
    """What a learner's author found best for a percept, where it differs from the options' defaults."""
    kind = find(learner)
    return {**kind.presets.get("", {}), **kind.presets.get(percept, {})}


def make_setup(learner: str = "qtable", **given: Any) -> Setup:
    """A setup with the learner's presets and some options given by name, as on a command line.

    Raises
    ------
    UserError
        for an unknown learner or option, or a value that does not fit.
    """
    structs = find(learner).Options, TaskOptions, Exploration
    known = {field for struct in structs for field in struct.__struct_fields__}
    if unknown := sorted(given.keys() - known):
        raise UserError(f"no option '{unknown[0]}' of the learner {learner}; there are: {', '.join(sorted(known))}")
    values = {**presets(learner, given.get("percept", TaskOptions().percept)), **given}
    own, task, exploration = structs
    return Setup(learner, convert(own, values), convert(task, values), convert(exploration, values))


DEFAULT_BUDGET = 3000
"""Epochs that the temperature's decay is spread over in a run without an end."""


def from_checkpoint(meta: Meta, source: str) -> Setup:
    """The setup that a checkpoint was made with.

    Raises
    ------
    UserError
        when its values do not fit; `source` names it.
    """
    try:
        return Setup(
            meta.learner,
            msgspec.convert(meta.hyperparameters, find(meta.learner).Options),
            msgspec.convert({"percept": meta.percept, "reward": meta.reward, "cap": meta.cap}, TaskOptions),
            msgspec.convert(meta.exploration, Exploration),
        )
    except msgspec.ValidationError as error:
        raise UserError(f"{source}: {error}") from None


def parse_setup(
    struct: type[Any], argv: Sequence[str] | None, prog: str, about: str, **more: type[Any]
) -> tuple[Any, ...]:
    """Read a command's own options together with the agent's; the learner's own are known by its name.

    `more` are further groups of options by their title. The result: own options, setup, further ones.

    Raises
    ------
    UserError
        for an unknown learner or a value that does not fit.
    """
    words = sys.argv[1:] if argv is None else argv
    name = peek(words, "--learner", LearnerOptions().learner)
    groups = {
        "": struct,
        "learner": LearnerOptions,
        "task": TaskOptions,
        "exploration": Exploration,
        f"hyperparameters of {name}": find(name).Options,
        **more,
    }
    defaults = presets(name, peek(words, "--percept", TaskOptions().percept))
    parsed = parse_groups(groups, words, prog, about, defaults=defaults)
    own, chosen, task, exploration, hyperparameters, *others = parsed
    return own, Setup(chosen.learner, hyperparameters, task, exploration), *others
