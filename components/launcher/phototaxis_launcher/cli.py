"""The `phototaxis` command line: a table of subcommands, each imported only when it is called."""

import re
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import requires
from typing import NamedTuple

from phototaxis import __version__
from phototaxis.runtime.errors import UserError, leave, one_line
from phototaxis.runtime.phrases import known
from phototaxis.runtime.roles import COMPONENTS


class Verb(NamedTuple):
    """One subcommand."""

    target: str
    """`module:function`; the function is called with the words after the verb."""
    extra: str
    """The package extra that installs what the subcommand needs."""
    about: str
    """What the subcommand does, in a line for the list of subcommands."""


VERBS = {
    "demo": Verb("phototaxis_launcher.demo:main", "demo", "learn 3,000 epochs over the bus, watch, evaluate"),
    "up": Verb("phototaxis_launcher.up:main", "launcher", "start a run: sim, sensors, agent, recorder"),
    "status": Verb(
        "phototaxis_launcher.ask:status", "launcher", "who is alive, which tick, who drives, what the run waits for"
    ),
    "control": Verb("phototaxis_launcher.ask:control", "launcher", "pause, resume, step, speed, reset, begin, stop"),
    "swap": Verb("phototaxis_launcher.swap:main", "launcher", "hand the seat to another learner while the robot runs"),
    "router": Verb("phototaxis_launcher.router:main", "launcher", "a Zenoh router, for components on several machines"),
    "certs": Verb("phototaxis_launcher.certs:main", "certs", "certificates and passwords for a guarded router"),
    "check": Verb(
        "phototaxis_lab.check:main", "lab", "test an agent against the contract; compare committed files with the code"
    ),
    **{name: Verb(f"phototaxis_{name}.__main__:main", name, role.about) for name, role in COMPONENTS.items()},
    "fmu": Verb("phototaxis_fmu.cli:main", "fmu", "inspect, check or build FMUs (sensor models)"),
    "view": Verb("phototaxis_recorder.view:main", "recorder", "the live view or a recording, in a window or browser"),
    "recordings": Verb("phototaxis_recorder.recordings:main", "recorder", "list recordings; remove old ones"),
    "health": Verb("phototaxis_launcher.health:main", "launcher", "is this component on the bus? for health checks"),
    "train": Verb("phototaxis_lab.train:main", "lab", "the same learning in one process, without a bus"),
    "experiment": Verb("phototaxis_lab.experiment:main", "lab", "a grid of agents and seeds, in parallel, resumable"),
    "reproduce": Verb("phototaxis_lab.reproduce:main", "lab", "the paper's experiments: a page of claims and figures"),
    "evaluate": Verb("phototaxis_lab.evaluate:main", "lab", "measure a frozen policy on fresh placements"),
}


def main() -> None:
    """Entry point of the `phototaxis` command."""
    leave(one_line(lambda: dispatch(sys.argv[1:])))


def dispatch(words: list[str]) -> int:
    """Call the subcommand that the first word names."""
    if not words or words[0] in ("-h", "--help"):
        print(usage())
        return 0
    if words[0] == "--version":
        print(__version__)
        return 0
    verb = VERBS.get(words[0])
    if verb is None:
        raise UserError(f"no command '{words[0]}'; {known(words[0], VERBS)}")
    module, _, function = verb.target.partition(":")
    try:
        command: Callable[[list[str]], int | None] = getattr(import_module(module), function)
        return command(words[1:]) or 0
    except ModuleNotFoundError as error:
        raise UserError(
            f"'phototaxis {words[0]}' needs the package {error.name}; install it with: "
            f"pip install 'phototaxis[{extra_with(error.name or '', verb.extra)}]' (in a clone: make setup)"
        ) from None


def extra_with(package: str, usual: str) -> str:
    """Return an extra that installs `package`: `usual`, unless only another extra names the package."""
    lines = requires("phototaxis") or []
    found = [match[1] for line in lines if (match := re.match(rf"{package}\b.*extra == .([\w-]+)", line))]
    return usual if not found or usual in found else found[0]


def usage() -> str:
    """Return the help text that lists the subcommands."""
    rows = [f"  {name:10} {verb.about}" for name, verb in VERBS.items()]
    return "\n".join(["usage: phototaxis COMMAND [OPTIONS]   (each has --help)", "", *rows])
