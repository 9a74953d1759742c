"""`phototaxis router`: a Zenoh router, for components that are not on one machine."""

import signal
import sys
from collections.abc import Sequence
from queue import SimpleQueue

from phototaxis.options import parse
from phototaxis.session import BusOptions, open_router


class Options(BusOptions, kw_only=True):
    """Options of the router."""


def main(argv: Sequence[str]) -> int:
    about = "A Zenoh router (zenohd does the same): the one place that components on several machines connect to."
    options = parse(Options, argv, "phototaxis router", about)
    ended: SimpleQueue[None] = SimpleQueue()  # whose put, unlike an Event's set, may interrupt its get
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.put(None))
    with open_router(options) as session:
        print(f"router {session.zid()} is up", file=sys.stderr, flush=True)
        ended.get()
    return 0
