"""Run one component so that the messages it publishes get lost or come twice, by a seeded draw.

    python lossy.py MODULE SHARE OPTIONS…

Every message of the lockstep path is dropped with probability SHARE and doubled with the same.
"""

import random
import sys
from importlib import import_module
from unittest.mock import patch

from phototaxis.runtime.bus import Bus
from phototaxis.wire.topics import TOPICS

module, share, options = sys.argv[1], float(sys.argv[2]), sys.argv[3:]
chance = random.Random(module)
put = Bus.put


def unreliable(bus: Bus, topic: str, message) -> None:
    draw = chance.random() if TOPICS[topic].kind == "stream" and topic != "status" else 0.5
    if draw < 1 - share:
        put(bus, topic, message)
    if draw < share:
        put(bus, topic, message)


with patch.object(Bus, "put", unreliable):
    import_module(f"{module}.__main__").main(options)
