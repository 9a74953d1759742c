"""A stranger in another network tries every way in that Zenoh has; files that do not open them keep it out."""

import json
import subprocess
import sys

import zenoh
from phototaxis.runtime.ports import free_ports

STRANGER = """
import sys, time, zenoh
config = zenoh.Config()  # as Zenoh comes: it scouts, gossips and listens
config.insert_json5("connect/endpoints", sys.argv[1])
wanted, deadline = set(sys.argv[2:]), time.monotonic() + 60
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
WORLDS = """
import sys
from contextlib import ExitStack
from pathlib import Path
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.session import BusOptions, open_session
with ExitStack() as stack:
    for file in sys.argv[1:]:
        world = Path(file).stem
        options = BusOptions(name=world, zenoh_config=file, insecure=world.startswith("asks-for"))
        session = stack.enter_context(open_session("sim", options))
        stack.enter_context(Bus(session, world, "sim", "test"))
    sys.stdin.read()
"""
"""Opens a world for each file; in a process of its own, since Zenoh looks for network interfaces once in a process."""


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
    for world, sections in {**files, **opened}.items():
        (tmp_path / f"{world}.json5").write_text(json.dumps(sections))
    argv = [*enter, sys.executable, "-c", STRANGER, json.dumps([f"tcp/{address}:{meeting}"]), *opened]
    hosting = [sys.executable, "-c", WORLDS, *(str(tmp_path / f"{world}.json5") for world in {**files, **opened})]
    with (
        zenoh.open(zenoh.Config.from_json5(json.dumps(between))),
        subprocess.Popen(argv, stdout=subprocess.PIPE, text=True) as stranger,
    ):
        assert stranger.stdout is not None
        assert stranger.stdout.readline() == "here\n"
        with subprocess.Popen(hosting, stdin=subprocess.PIPE) as hosts:  # each scouts at once: the last is found last
            found = stranger.stdout.read().split()
            hosts.communicate()
    assert found == sorted(opened)
