"""A stranger in another network tries every way in that Zenoh has; files that do not open them keep it out."""

import json
import subprocess
import sys
from contextlib import ExitStack

import zenoh
from phototaxis.bus import Bus
from phototaxis.ports import free_ports
from phototaxis.session import BusOptions, open_session

STRANGER = """
import sys, time, zenoh
config = zenoh.Config()  # as Zenoh comes: it scouts, gossips and listens
config.insert_json5("connect/endpoints", sys.argv[1])
heard, wanted, deadline = set(), set(sys.argv[2:]), time.monotonic() + 60
with zenoh.open(config) as session:
    print("here", flush=True)
    def worlds():
        found = session.liveliness().get("*/alive/**", timeout=0.5)
        return {str(reply.ok.key_expr).split("/")[0] for reply in found if reply.ok}
    while not wanted <= worlds() and time.monotonic() < deadline:
        pass
    print(*sorted(worlds()))
"""
"""Prints the worlds that it finds, when it has found those that it is told to find."""


def test_what_a_file_leaves_out_lets_no_stranger_in(namespace, tmp_path):
    enter, address = namespace
    meeting, inner, *ports = free_ports(6)
    here = [f"tcp/127.0.0.1:{port}" for port in ports]
    friend, connect = f"tcp/127.0.0.1:{inner}", {"endpoints": [f"tcp/127.0.0.1:{inner}"]}
    files = {
        "listens": {"listen": {"endpoints": [here[0]]}},
        "listens-as-router": {"mode": "router", "listen": {"endpoints": [here[1]]}},
        "dials": {"connect": connect},
        "dials-as-router": {"mode": "router", "connect": connect},
        "listens-and-dials": {"listen": {"endpoints": [here[2]]}, "connect": connect},
        "with-an-address": {
            "listen": {"endpoints": [here[3]]},
            "scouting": {"multicast": {"address": "224.0.0.224:7446"}},
        },
    }
    opened = {
        "asks-for-multicast": {
            "listen": {"endpoints": [f"tcp/{address}:0"]},
            "scouting": {"multicast": {"enabled": True}},
        },
        "asks-for-gossip": {"connect": connect, "scouting": {"gossip": {"enabled": True}}},
    }
    gossip = {"multicast": {"enabled": False}, "gossip": {"enabled": True}}
    between = {"listen": {"endpoints": [friend, f"tcp/{address}:{meeting}"]}, "scouting": gossip}
    with ExitStack() as stack:
        stack.enter_context(zenoh.open(zenoh.Config.from_json5(json.dumps(between))))
        argv = [*enter, sys.executable, "-c", STRANGER, json.dumps([f"tcp/{address}:{meeting}"]), *opened]
        stranger = stack.enter_context(subprocess.Popen(argv, stdout=subprocess.PIPE, text=True))
        assert stranger.stdout is not None
        assert stranger.stdout.readline() == "here\n"
        for world, sections in {**files, **opened}.items():  # each scouts at once, so the last is found last
            file = tmp_path / f"{world}.json5"
            file.write_text(json.dumps(sections))
            options = BusOptions(name=world, zenoh_config=str(file), insecure=world in opened)
            session = stack.enter_context(open_session("sim", options))
            stack.enter_context(Bus(session, world, "sim", "test"))
        assert stranger.stdout.read().split() == sorted(opened)
