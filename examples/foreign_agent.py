"""An agent that uses only this project's wire format (docs/wire.md), none of its code; it steers to the brighter side.

phototaxis router --listen tcp/127.0.0.1:7447 &
phototaxis sim --connect tcp/127.0.0.1:7447 &
phototaxis sensors --connect tcp/127.0.0.1:7447 &
python examples/foreign_agent.py tcp/127.0.0.1:7447
"""

import json
import sys
from queue import Empty, SimpleQueue

import msgpack
import zenoh

if len(sys.argv) < 2:
    sys.exit("give the router's address, as in: python examples/foreign_agent.py tcp/127.0.0.1:7447 [WORLD]")
endpoint, world, me = sys.argv[1], "".join(sys.argv[2:3]) or "phototaxis", "chaser"
connect = {"endpoints": [endpoint], "timeout_ms": 2000, "exit_on_failure": True}
config = {"mode": "client", "connect": connect, "scouting": {"multicast": {"enabled": False}}}
try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
except zenoh.ZError:
    sys.exit(f"no router answers at {endpoint}; start one with: phototaxis router --listen {endpoint}")
with session:
    print(f"{me} waits for the world {world} at {endpoint}", file=sys.stderr)
    inbox: SimpleQueue = SimpleQueue()
    publisher = session.declare_publisher(f"{world}/command", congestion_control=zenoh.CongestionControl.BLOCK)
    session.declare_subscriber(
        f"{world}/readings", lambda sample: inbox.put(msgpack.unpackb(sample.payload.to_bytes()))
    )
    token = session.liveliness().declare_token(f"{world}/alive/agent/{me}")  # exists as long as this variable
    run, newest, claim = "", -1, msgpack.packb({"verb": "claim", "agent": me})
    while True:
        try:
            readings = inbox.get(timeout=30)
        except (Empty, KeyboardInterrupt):
            break  # no readings for 30 s, or Ctrl-C
        if readings["run"] != run:
            run, newest = readings["run"], -1
        if not readings["driver"]:
            list(session.get(f"{world}/control", payload=claim, timeout=2))
        elif readings["driver"] == me and readings["tick"] >= newest:
            newest = readings["tick"]
            left, right = readings["light"]
            ahead = min(readings["sonar"][3:5]) > 0.5
            motors = ((0, 1) if left > right else (1, 0)) if ahead else (-1, 1)
            end = "terminated" if max(left, right) > 0.95 else ""
            answer = {"run": run, "tick": newest, "author": me, "end": end}
            publisher.put(msgpack.packb(answer | {"left": motors[0], "right": motors[1]}))
