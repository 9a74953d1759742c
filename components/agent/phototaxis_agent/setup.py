"""Makes an agent from command-line options, over the bus and in one process alike."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import msgspec
from msgspec import Struct
from phototaxis.runtime.checkpoint import CheckpointMetadata
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import convert, parse_groups, peek
from phototaxis.runtime.phrases import known, plain
from phototaxis.task import TaskOptions
from phototaxis.wire.messages import World

from phototaxis_agent.agent import Agent
from phototaxis_agent.exploration import Exploration
from phototaxis_agent.learner import find_learner
from phototaxis_agent.policy import Policy
from phototaxis_agent.watchdog import watchdog


class LearnerOptions(Struct, kw_only=True):
    """The option that selects the learner."""

    learner: str = "qtable"
    """name of the learner"""


class AgentSetup(Struct):
    """Everything that defines an agent but the world and the seed."""

    learner: str
    hyperparameters: Any
    task: TaskOptions
    exploration: Exploration

    def agent(
        self, world: World, *, seed: int | None = None, budget: int | None = None, learning: bool = True
    ) -> Agent:
        """An agent for a world; `seed` and `budget` are the world's unless they are given.

        Raises
        ------
        UserError
            when the learner does not go with the percept, or raises; then it names the file and the line.
        """
        policy = self._policy(
            near=world.arena.sensing.near,
            seed=world.seed if seed is None else seed,
            budget=budget or world.epochs or DEFAULT_BUDGET_EPOCHS,
            learning=learning,
        )
        agent = Agent(policy)
        agent.enter(world.arena)
        return agent

    def check(self) -> None:
        """Make the policy and throw it away: a UserError before anything else is started, as from `agent`."""
        self._policy(near=1.0, seed=0, budget=1)

    def _policy(self, **given: Any) -> Policy:
        with watchdog():
            return Policy(self.learner, self.hyperparameters, self.task, self.exploration, **given)


def presets(learner: str, percept: str) -> dict[str, Any]:
    """What a learner's author found best for a percept, where it differs from the options' defaults."""
    kind = find_learner(learner)
    return {**kind.presets.get("", {}), **kind.presets.get(percept, {})}


def make_setup(learner: str = "qtable", **given: Any) -> AgentSetup:
    """A setup with the learner's presets and some options given by name, as on a command line.

    Raises
    ------
    UserError
        for an unknown learner or option, or a value that does not fit.
    """
    structs = find_learner(learner).Options, TaskOptions, Exploration
    _refuse_doubles(learner, structs[1:])
    options = {field for struct in structs for field in struct.__struct_fields__}
    if unknown := sorted(given.keys() - options):
        raise UserError(f"no option '{unknown[0]}' of the learner {learner}; {known(unknown[0], sorted(options))}")
    values = {**presets(learner, given.get("percept", TaskOptions().percept)), **given}
    own, task, exploration = structs
    parts = convert(own, values, str), convert(task, values, str), convert(exploration, values, str)
    return AgentSetup(learner, *parts)


def _refuse_doubles(learner: str, structs: Iterable[type[Any]], others: Iterable[str] = ()) -> None:
    """Raise UserError for a hyperparameter that is called as a field of `structs` or as one of the options `others`."""
    taken = {"learner", "help", *(field for struct in structs for field in struct.__struct_fields__)}
    taken |= {option.removeprefix("--").replace("-", "_") for option in others}
    for field in find_learner(learner).Options.__struct_fields__:
        if field in taken:
            raise UserError(
                f"the learner '{learner}' calls a hyperparameter '{field}', which is an option of Phototaxis itself; "
                "give it another name"
            )


DEFAULT_BUDGET_EPOCHS = 3000
"""Epochs over which the temperature falls in a run without an end."""


def from_checkpoint(meta: CheckpointMetadata, source: str) -> AgentSetup:
    """The setup that a checkpoint was made with.

    Raises
    ------
    UserError
        when its values do not fit; `source` names it.
    """
    try:
        return AgentSetup(
            meta.learner,
            msgspec.convert(meta.hyperparameters, find_learner(meta.learner).Options),
            msgspec.convert({name: getattr(meta, name) for name in TaskOptions.__struct_fields__}, TaskOptions),
            msgspec.convert(meta.exploration, Exploration),
        )
    except msgspec.ValidationError as error:
        raise UserError(f"{source}: {plain(str(error))}") from None


def parse_setup(
    struct: type[Any],
    argv: Sequence[str] | None,
    prog: str,
    about: str,
    more: Mapping[str, type[Any]] = MappingProxyType({}),
    others: Iterable[str] = (),
) -> tuple[Any, ...]:
    """Read a command's own options together with the agent's; the learner's own are known by its name.

    `more` are further groups of options by their title, `others` options that a mistyped one may have meant.
    The result: own options, setup, further ones.

    Raises
    ------
    UserError
        for an unknown learner, one that cannot be made, or a value that does not fit.
    """
    words = sys.argv[1:] if argv is None else argv
    name = peek(words, "--learner", LearnerOptions().learner)
    others = [*others]
    _refuse_doubles(name, [struct, TaskOptions, Exploration, *more.values()], others)
    groups = {
        "": struct,
        "learner": LearnerOptions,
        "task": TaskOptions,
        "exploration": Exploration,
        f"hyperparameters of {name}": find_learner(name).Options,
        **more,
    }
    defaults = presets(name, peek(words, "--percept", TaskOptions().percept))
    see = f"{prog} --learner {name}"
    parsed = parse_groups(groups, words, prog, about, defaults=defaults, more=others, see=see)
    own, chosen, task, exploration, hyperparameters, *rest = parsed
    setup = AgentSetup(chosen.learner, hyperparameters, task, exploration)
    setup.check()
    return own, setup, *rest
