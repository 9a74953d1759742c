"""`phototaxis swap`: lets another learner take over the seat of a running system."""

import json
import sys
from collections.abc import Sequence
from typing import Annotated

from msgspec import Meta
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.options import Parser, add_options, convert
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.messages import Control, LaunchReply, LaunchRequest, Status

from phototaxis_launcher.options import for_ours

LINKED_WITHIN_S = 2.0


class Options(BusOptions, kw_only=True):
    """Options of `phototaxis swap`; options of `phototaxis agent` are accepted too and passed on to the new agent."""

    learner: str
    """name of the learner that takes over"""
    timeout: Annotated[float, Meta(gt=0, le=3600)] = 60.0
    """seconds within which the new agent must drive"""
    json: bool = False
    """print the result as one JSON object"""


def main(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="phototaxis swap",
        description="Hand the seat of a running system to a new agent, which inherits from a driver of the same kind.",
        epilog="Options of `phototaxis agent` (see its --help) are passed on to the agent.",
    )
    add_options(parser, Options, positional=["learner"])
    own, words = parser.parse_known_args(argv)
    options = convert(Options, vars(own))
    reply = _ask(options, LaunchRequest(words=["--learner", options.learner, *for_ours(words)]))
    if reply.reason:
        raise UserError(reply.reason)
    if options.json:
        print(json.dumps({"agent": reply.agent, "from_tick": reply.tick}))
    else:
        print(f"{reply.agent} drives from tick {reply.tick} on", file=sys.stderr)
    return 0


def _ask(options: Options, request: LaunchRequest) -> LaunchReply:
    with open_session("observer", options) as session, Bus(session, options.name, "observer", "swap") as bus:
        if not bus.wait_for("launcher", LINKED_WITHIN_S):
            raise Unavailable(
                f"no `phototaxis up` runs the world '{options.name}'; start the agent yourself: "
                f"phototaxis agent --learner {options.learner} --take-over"
            )
        now = bus.control(Control(verb="status"))
        if now is not None and (delay := what_delays(now.status)):
            print(delay, file=sys.stderr)
        reply = bus.ask_one("launch", request, timeout=options.timeout)
    if reply is None:
        raise Unavailable(
            f"the new agent did not take the seat within {options.timeout:g} s; see its log in the run's folder"
        )
    return reply


def what_delays(status: Status) -> str:
    """Say why a new agent does not drive at once; "" when nothing delays it.

    Raises
    ------
    Unavailable
        when the run is finished, so that the agent would never drive.
    """
    if status.phase == "finished":
        raise Unavailable(f"the run {status.run} is finished: nobody can take its seat any more")
    resume = "the simulation is paused; the new agent drives when it goes on: phototaxis control resume"
    return resume if status.phase == "paused" else ""
