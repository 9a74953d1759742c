"""`phototaxis agent`: a learner as a process."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.component import ComponentOptions, entry, run
from phototaxis.runtime.disk import check_writable
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.seat_client import Mode
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.runtime.session import WorldNames
from phototaxis.wire.messages import Count, Seed, World

from phototaxis_agent.policies import load_policy
from phototaxis_agent.server import serve
from phototaxis_agent.setup import AgentSetup, parse_setup


class Options(ComponentOptions, kw_only=True):
    """Options of the agent process."""

    worlds: WorldNames | None = None
    """several worlds instead of --name, separated by commas; this process runs one agent for each"""
    checkpoint: str = ""
    """file (.npz) in which the learner's state is kept; with --worlds a folder that holds WORLD.npz for each"""
    resume: str = ""
    """checkpoint to begin with"""
    take_over: bool = False
    """take the seat from the driver at the next tick boundary, and exit when a successor drives"""
    at: Count = 0
    """first tick at which --take-over may happen"""
    standby: bool = False
    """drive when the driver vanishes; until then keep its state (same learner and percept) or learn from its driving"""
    policy: str = ""
    """file (.zip) with a frozen policy saved by Stable-Baselines3, which drives instead of a learner"""
    trust: bool = False
    """load the policy file, which can run any code; use this only if you trust its author"""
    normalize: str = ""
    """file (.pkl) of VecNormalize.save with the statistics of the policy's observations"""
    agent_seed: Seed | None = None
    """seed of the learner and its exploration (default: the run's)"""


def read(argv: Sequence[str] | None, others: Iterable[str] = ()) -> tuple[Options, AgentSetup]:
    """The options and the agent of a command line, checked as far as that is possible without a world.

    `others` are options that a mistyped one may have meant. `phototaxis up` calls this before it starts anything.

    Raises
    ------
    UserError
        for an unknown learner, one that cannot be made, or a value that does not fit.
    """
    about = "Run a learner that drives the robot."
    options, setup = parse_setup(Options, argv, "phototaxis agent", about, others=others)
    if options.take_over and options.standby:
        raise UserError("--take-over and --standby exclude each other")
    if options.policy and (options.checkpoint or options.resume):
        raise UserError("--policy learns nothing: leave --checkpoint and --resume out")
    if options.normalize and not options.policy:
        raise UserError("--normalize belongs to a policy: give its file, too: --policy FILE.zip")
    if options.resume:
        load(Path(options.resume))
    return options, setup


def main(argv: Sequence[str] | None = None) -> None:
    options, setup = read(argv)
    worlds = options.worlds.split(",") if options.worlds else []
    kept = Path(options.checkpoint) if options.checkpoint else None
    for file in [] if kept is None else [kept / f"{name}.npz" for name in worlds] or [kept]:
        check_writable(file, "--checkpoint")
        check_writable(file.with_suffix(".journal"), "--checkpoint")
    mode: Mode = "take over" if options.take_over else "stand by" if options.standby else "claim"

    policy = load_policy(Path(options.policy), options.trust, options.normalize) if options.policy else None

    def make(world: World) -> SeatedAgent:
        return policy(world, setup.task.max_episode_steps) if policy else setup.agent(world, seed=options.agent_seed)

    def serve_world(bus: Bus) -> None:
        path = kept / f"{bus.name}.npz" if kept is not None and worlds else kept
        resume = Path(options.resume) if options.resume else path if options.restarted else None
        serve(bus, make, path, resume, bool(options.resume), mode, options.at)

    run("agent", options, serve_world, "policy" if options.policy else setup.learner, worlds)


if __name__ == "__main__":
    entry(main)
