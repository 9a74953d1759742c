"""`phototaxis health`: does this component take part in the bus? For the health checks of containers."""

import time
from collections.abc import Sequence

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.options import parse
from phototaxis.runtime.phrases import known
from phototaxis.runtime.roles import COMPONENTS
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis.wire.messages import Control

ANSWERS_WITHIN_S = 3.0
"""A component of which nothing is heard for so long is not healthy."""
ROLES = ("router", *COMPONENTS)


class Options(BusOptions, kw_only=True):
    """Options of `phototaxis health`."""

    role: str
    """router: the bus can be entered; sim: its token is there, and it answers; another component: its token is there"""
    label: str = ""
    """the component's own --label (default: any component of that role)"""


def main(argv: Sequence[str]) -> int:
    options = parse(Options, argv, "phototaxis health", "Succeed if the component is on the bus.", positional=["role"])
    if options.role not in ROLES:
        raise UserError(f"ROLE {options.role}: no such role; {known(options.role, ROLES)}")
    with open_session("observer", options) as session:
        if options.role == "router":
            return 0
        with Bus(session, options.name, "observer", "health") as bus:
            deadline = time.monotonic() + ANSWERS_WITHIN_S
            while (left := deadline - time.monotonic()) > 0:
                event = bus.receive(timeout=left)
                if event is None or event.topic != "alive" or event.message[0] != options.role:
                    continue
                if options.label and f"-{options.label}-" not in event.message[1]:
                    continue
                if options.role != "sim" or bus.control(Control(verb="status")) is not None:
                    return 0
    who = f"{options.role} {options.label}".rstrip()
    raise Unavailable(f"no {who} answers on the bus of '{options.name}'")
