"""Measures a bare ring: three Python processes that pass on payloads of our sizes, with our Zenoh configuration.

    python benchmarks/ring.py TICKS

It prints the ring's ticks/s, the upper limit that Zenoh, Python's threads and this machine set for our processes.
"""

import subprocess
import sys
import time
from queue import Empty, SimpleQueue
from typing import Any

import zenoh
from phototaxis.runtime.session import BusOptions, open_session
from zenoh.handlers import Callback

SIZES = {"state": 213, "readings": 281, "command": 73}
"""Bytes of our three messages (measured: `benchmarks/run.py` prints them)."""
NEXT = {"sim": ("command", "state"), "sensors": ("state", "readings"), "agent": ("readings", "command")}
"""The message that each process waits for, and the one that it then sends."""


def member(session: zenoh.Session, name: str, role: str) -> tuple[SimpleQueue[Any], zenoh.Publisher]:
    """Return the inbox and the publisher of one process of the ring."""
    inbox: SimpleQueue[Any] = SimpleQueue()
    reads, writes = NEXT[role]
    session.declare_subscriber(f"{name}/{reads}", Callback(inbox.put, indirect=False))
    publisher = session.declare_publisher(
        f"{name}/{writes}", congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    return inbox, publisher


def came(inbox: SimpleQueue[Any], seconds: float) -> bool:
    """Take a message out of the inbox; return whether one came within `seconds`."""
    try:
        inbox.get(timeout=seconds)
    except Empty:
        return False
    return True


def follow(role: str, name: str) -> None:
    """Answer each message with a payload of our size, until an empty message comes."""
    payload = bytes(SIZES[NEXT[role][1]])
    with open_session(role, BusOptions(name=name)) as session:
        inbox, publisher = member(session, name, role)
        while bytes(inbox.get().payload):
            publisher.put(payload)
        publisher.put(b"")


def lead(name: str, ticks: int) -> float:
    """Start the other processes, and measure the ticks/s of the ring."""
    followers = [subprocess.Popen([sys.executable, __file__, role, name]) for role in NEXT if role != "sim"]
    payload = bytes(SIZES["state"])
    with open_session("sim", BusOptions(name=name)) as session:
        inbox, publisher = member(session, name, "sim")
        while not came(inbox, 0.05):  # until both processes are connected
            publisher.put(payload)
        while came(inbox, 0.2):  # until the ring is empty again
            pass
        began = time.perf_counter()
        for _ in range(ticks):
            publisher.put(payload)
            bytes(inbox.get().payload)
        rate = ticks / (time.perf_counter() - began)
        publisher.put(b"")
        for follower in followers:
            follower.wait(10)
    return rate


if __name__ == "__main__":
    if len(sys.argv) == 3:
        follow(sys.argv[1], sys.argv[2])
    else:
        print(lead("ring", int(sys.argv[1])))
