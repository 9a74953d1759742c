"""The options of `phototaxis up`: its own, those of the sensor models, and those that it passes on to agents."""

import re
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated

from msgspec import Meta
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.options import Parser, add_options, convert, flags, peek
from phototaxis.runtime.session import BusOptions
from phototaxis.wire.messages import MAX_ROBOTS, Count, Seed

PORT = Annotated[int, Meta(ge=-1, le=65535)]
STANDALONE_OPTIONS = ("--checkpoint", "--policy", "--standby", "--take-over", "--at", "--worlds", "--ident")
"""Options for agents that a user starts alone; the launcher sets them for the agents that it starts."""
SWAP_PATTERN = re.compile(r"(?P<tick>[0-9]+):(?P<learner>[^:,\s]+)")


class UpOptions(BusOptions, kw_only=True):
    """Options of a run; options of `phototaxis agent` are accepted too and passed on to the agent."""

    arena: str = "paper"
    """name of a shipped arena, or a TOML file"""
    seed: Seed = 0
    """seed of all randomness: placements, noise, the learner and its exploration"""
    epochs: Count = 3000
    """learning steps; 0: run until stopped"""
    speed: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """simulated seconds per second; 0: lockstep, as fast as possible"""
    robots: Annotated[int, Meta(ge=1, le=MAX_ROBOTS)] = 1
    """number of robots, each alone in its own arena; one learner drives them all, and only the first is recorded"""
    swap: str = ""
    """TICK:LEARNER,…: at these ticks fresh agents take over; an agent inherits from a driver with the same learner,
    and learns in the shadow of one with another"""
    out: str = "runs"
    """folder in which the run makes its own folder, with recording, checkpoint and logs"""
    no_recorder: bool = False
    """run without recording and viewer"""
    grpc_port: PORT = 9876
    """port of the recorder's Rerun server; 0: any free one"""
    web_port: PORT = 9090
    """port of the web viewer; 0: any free one; -1: no web viewer"""
    json: bool = False
    """print the result as one JSON object, as the last line of standard output"""

    def bus_flags(self) -> list[str]:
        """Return the flags with which a child process joins the same bus."""
        return flags(BusOptions(**{field: getattr(self, field) for field in BusOptions.__struct_fields__}))


def parse(argv: Sequence[str], prog: str = "phototaxis up") -> tuple[UpOptions, FmuOptions, list[str]]:
    """Split a command line into the launcher's options, the sensor models' options, and words for the agent."""
    parser = Parser(
        prog=prog,
        description="Start simulation, sensors, agent and recorder, and restart them when they fail.",
        epilog="Options of `phototaxis agent` (see its --help) are passed on to the agent.",
    )
    add_options(parser, UpOptions)
    add_options(parser.add_argument_group("sensor models"), FmuOptions)
    own, words = parser.parse_known_args(argv)
    options = convert(UpOptions, vars(own))
    if options.listen:
        raise UserError(f"--listen is for single components; {prog} connects its own; for a router, use --connect")
    for learner in {learner_of(words), *(learner for _, learner in swap_plan(options.swap))}:
        import_module("phototaxis_agent.__main__").read(successor(words, ["--learner", learner]), parser.option_strings)
    return options, convert(FmuOptions, vars(own)), for_ours(words)


def for_ours(words: list[str]) -> list[str]:
    """Return the words unchanged; UserError when one is an option only for agents that a user starts alone."""
    for word in words:
        if (option := word.split("=")[0]) in STANDALONE_OPTIONS:
            raise UserError(f"{option} is for an agent that is started alone, beside a run: phototaxis agent {option}")
    return words


def successor(first: list[str], words: list[str]) -> list[str]:
    """Return the words for a new agent: those of the first agent, then its own.

    If its learner differs from the first agent's, it keeps only the first agent's --percept.
    """
    if learner_of(words) == learner_of(first):
        return [*first, *words]
    percept = peek(first, "--percept", "")
    return [*([f"--percept={percept}"] if percept else []), *words]


def swap_plan(text: str) -> list[tuple[int, str]]:
    """Parse TICK:LEARNER,… into ticks and learners; UserError when the text has another form."""
    found = [SWAP_PATTERN.fullmatch(part) for part in text.split(",")] if text else []
    plan = [(int(one["tick"]), one["learner"]) for one in found if one]
    if len(plan) < len(found) or sorted({tick for tick, _ in plan}) != [tick for tick, _ in plan]:
        raise UserError(f"--swap {text}: expected TICK:LEARNER with increasing ticks, as in 1000:qtable,2000:dqn")
    return plan


def learner_of(words: Sequence[str]) -> str:
    """Return the learner that an agent's words select."""
    return peek(words, "--learner", "qtable")
