"""The bare ring: three Python processes that pass payloads of our sizes round, in our configuration.

    python benchmarks/ring.py TICKS

Prints the ring's ticks/s: what Zenoh, Python's threads and this machine allow before any of our code.
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
"""What each process waits for, and what it then sends."""


def member(session: zenoh.Session, name: str, role: str) -> tuple[SimpleQueue[Any], zenoh.Publisher]:
    """A place in the ring: an inbox and a publisher."""
    inbox: SimpleQueue[Any] = SimpleQueue()
    reads, writes = NEXT[role]
    session.declare_subscriber(f"{name}/{reads}", Callback(inbox.put, indirect=False))
    publisher = session.declare_publisher(
        f"{name}/{writes}", congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    return inbox, publisher


def came(inbox: SimpleQueue[Any], seconds: float) -> bool:
    """Whether something came within some seconds; it is taken out."""
    try:
        inbox.get(timeout=seconds)
    except Empty:
        return False
    return True


def follow(role: str, name: str) -> None:
    """Pass on whatever comes until it is empty."""
    payload = bytes(SIZES[NEXT[role][1]])
    with open_session(role, BusOptions(name=name)) as session:
        inbox, publisher = member(session, name, role)
        while bytes(inbox.get().payload):
            publisher.put(payload)
        publisher.put(b"")


def lead(name: str, ticks: int) -> float:
    """Start the others and count: ticks/s."""
    followers = [subprocess.Popen([sys.executable, __file__, role, name]) for role in NEXT if role != "sim"]
    payload = bytes(SIZES["state"])
    with open_session("sim", BusOptions(name=name)) as session:
        inbox, publisher = member(session, name, "sim")
        while not came(inbox, 0.05):  # until both are there
            publisher.put(payload)
        while came(inbox, 0.2):  # what still goes round
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
