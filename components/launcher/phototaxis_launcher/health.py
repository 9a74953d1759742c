"""`phototaxis health`: does this component take part in the bus? For the health checks of containers."""

import time
from collections.abc import Sequence
from typing import Literal

from phototaxis.bus import Bus
from phototaxis.errors import Unavailable
from phototaxis.messages import Control
from phototaxis.options import parse
from phototaxis.session import BusOptions, open_session

PATIENCE = 3.0


class Options(BusOptions, kw_only=True):
    """Options of `phototaxis health`."""

    role: Literal["router", "sim", "sensors", "agent", "recorder"]
    """router: the bus can be entered; the others: the component's token is there; sim: it answers as well"""
    id: str = ""
    """the component's own --id (default: any component of that role)"""


def main(argv: Sequence[str]) -> int:
    options = parse(Options, argv, "phototaxis health", "Succeed if the component is on the bus.", positional=["role"])
    with open_session("observer", options) as session:
        if options.role == "router":
            return 0
        with Bus(session, options.name, "observer", "health") as bus:
            deadline = time.monotonic() + PATIENCE
            while (left := deadline - time.monotonic()) > 0:
                event = bus.receive(timeout=left)
                if event is None or event.topic != "alive" or event.message[0] != options.role:
                    continue
                if options.id and f"-{options.id}-" not in event.message[1]:
                    continue
                if options.role != "sim" or bus.control(Control(verb="status")) is not None:
                    return 0
    who = f"{options.role} {options.id}".rstrip()
    raise Unavailable(f"no {who} answers on the bus of '{options.name}'")
