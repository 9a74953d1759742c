"""`phototaxis health`: tells a container's health check whether a component is on the bus."""

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
"""Seconds after which a component that has not shown itself on the bus counts as unhealthy."""
ROLES = ("router", *COMPONENTS)


class Options(BusOptions, kw_only=True):
    """Options of `phototaxis health`."""

    role: str
    """what to check; router: a session can be opened; sim: it is on the bus and answers; others: on the bus"""
    label: str = ""
    """the --label of the component (default: any component of that role)"""


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
