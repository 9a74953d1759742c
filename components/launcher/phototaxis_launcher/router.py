"""`phototaxis router`: a Zenoh router, for components on several machines."""

import signal
import sys
from collections.abc import Sequence

from phototaxis.runtime.errors import EXIT_INTERRUPTED
from phototaxis.runtime.options import parse
from phototaxis.runtime.session import BusOptions, open_router


class Options(BusOptions, kw_only=True):
    """Options of the router."""


def main(argv: Sequence[str]) -> int:
    about = "Run a Zenoh router (zenohd does the same), to which components on several machines connect."
    options = parse(Options, argv, "phototaxis router", about)
    ends = {signal.SIGTERM, signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, ends)  # blocked signals stay pending, so sigwait misses none
    with open_router(options) as session:
        print(f"router {session.zid()} is up", file=sys.stderr, flush=True)
        ended_by = signal.sigwait(ends)
    return EXIT_INTERRUPTED if ended_by == signal.SIGINT else 0
