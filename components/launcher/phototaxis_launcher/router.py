"""`phototaxis router`: a Zenoh router, for components that are not on one machine."""

import signal
import sys
from collections.abc import Sequence

from phototaxis.runtime.errors import EXIT_INTERRUPTED
from phototaxis.runtime.options import parse
from phototaxis.runtime.session import BusOptions, open_router


class Options(BusOptions, kw_only=True):
    """Options of the router."""


def main(argv: Sequence[str]) -> int:
    about = "A Zenoh router (zenohd does the same): the one place that components on several machines connect to."
    options = parse(Options, argv, "phototaxis router", about)
    ends = {signal.SIGTERM, signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, ends)  # a handler's word is lost when it comes just before we wait for it
    with open_router(options) as session:
        print(f"router {session.zid()} is up", file=sys.stderr, flush=True)
        ended_by = signal.sigwait(ends)
    return EXIT_INTERRUPTED if ended_by == signal.SIGINT else 0
