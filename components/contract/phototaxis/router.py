"""`phototaxis router`: where components on several machines or in containers meet, in place of a zenohd."""

import signal
import threading
from collections.abc import Sequence

from phototaxis.options import parse
from phototaxis.session import BusOptions, open_session


def main(argv: Sequence[str] | None = None) -> None:
    options = parse(BusOptions, argv, "phototaxis router", "Route the bus for components elsewhere (a Zenoh router).")
    if not options.listen and not options.zenoh_config:
        options.listen = ["tcp/127.0.0.1:7447"]
    end = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: end.set())
    with open_session("router", options):
        end.wait()
