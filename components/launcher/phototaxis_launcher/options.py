"""The options of `phototaxis up`: its own, those of the sensors' models, and the words for its agents."""

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
"""Options of an agent that is started alone; the launcher gives its own agents theirs."""
SWAP_PATTERN = re.compile(r"(?P<tick>[0-9]+):(?P<learner>[^:,\s]+)")


class UpOptions(BusOptions, kw_only=True):
    """Options of a run. Every option of `phototaxis agent` is understood too and passed on to it."""

    arena: str = "paper"
    """name of a shipped arena, or a TOML file"""
    seed: Seed = 0
    """decides everything: placements, noise, the learner and its exploration"""
    epochs: Count = 3000
    """learning steps; 0: run until stopped"""
    speed: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """simulated seconds per second; 0: lockstep, as fast as it goes"""
    robots: Annotated[int, Meta(ge=1, le=MAX_ROBOTS)] = 1
    """so many robots at once, each alone in its arena; one learner drives them all, the first is recorded"""
    swap: str = ""
    """TICK:LEARNER,…: at these ticks fresh agents take over; they inherit from one of their kind, and learn in the
    shadow of another"""
    out: str = "runs"
    """folder for the run's own folder: recording, checkpoint, logs"""
    no_recorder: bool = False
    """run without a recording and a viewer"""
    grpc_port: PORT = 9876
    """port of the recorder's Rerun server; 0: any free one"""
    web_port: PORT = 9090
    """port of the web viewer; 0: any free one; -1: no web viewer"""
    json: bool = False
    """print the result as one JSON object, last on standard output"""

    def bus_flags(self) -> list[str]:
        """Flags that lead a child process to the same bus."""
        return flags(BusOptions(**{field: getattr(self, field) for field in BusOptions.__struct_fields__}))


def parse(argv: Sequence[str], prog: str = "phototaxis up") -> tuple[UpOptions, FmuOptions, list[str]]:
    """Our own options, those of the sensors, and the words for the agent."""
    parser = Parser(
        prog=prog,
        description="Start simulation, sensors, agent and recorder, and watch over them.",
        epilog="Options of `phototaxis agent` (see its --help) are passed on to the agent.",
    )
    add_options(parser, UpOptions)
    add_options(parser.add_argument_group("sensor models"), FmuOptions)
    own, words = parser.parse_known_args(argv)
    options = convert(UpOptions, vars(own))
    if options.listen:
        raise UserError(f"--listen is for single components; {prog} links its own, or uses a router with --connect")
    for learner in {learner_of(words), *(learner for _, learner in swap_plan(options.swap))}:
        import_module("phototaxis_agent.__main__").read(successor(words, ["--learner", learner]), parser.option_strings)
    return options, convert(FmuOptions, vars(own)), for_ours(words)


def for_ours(words: list[str]) -> list[str]:
    """Words for an agent that the launcher starts; UserError when one is for an agent that is started alone."""
    for word in words:
        if (option := word.split("=")[0]) in STANDALONE_OPTIONS:
            raise UserError(f"{option} is for an agent that is started alone, beside a run: phototaxis agent {option}")
    return words


def successor(first: list[str], words: list[str]) -> list[str]:
    """Words for a new agent: what the first one was given comes first, as far as it is not another learner's."""
    if learner_of(words) == learner_of(first):
        return [*first, *words]
    percept = peek(first, "--percept", "")
    return [*([f"--percept={percept}"] if percept else []), *words]


def swap_plan(text: str) -> list[tuple[int, str]]:
    """The ticks and learners of TICK:LEARNER,…; UserError when it is something else."""
    found = [SWAP_PATTERN.fullmatch(part) for part in text.split(",")] if text else []
    plan = [(int(one["tick"]), one["learner"]) for one in found if one]
    if len(plan) < len(found) or sorted({tick for tick, _ in plan}) != [tick for tick, _ in plan]:
        raise UserError(f"--swap {text}: expected TICK:LEARNER with growing ticks, as in 1000:qtable,2000:dqn")
    return plan


def learner_of(words: Sequence[str]) -> str:
    """The learner that an agent's words name."""
    return peek(words, "--learner", "qtable")
