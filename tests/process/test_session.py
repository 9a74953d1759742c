"""The same run through a router, from flags and from ZENOH_CONFIG; no door is left open unasked."""

import json
import time

import pytest
import zenoh
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.ports import free_ports
from phototaxis.runtime.session import BusOptions, open_session
from support import DEADLINE, phototaxis, wait_status


@pytest.fixture
def router():
    """A Zenoh router on a free loopback port; yields its endpoint."""
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    config = zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": "router",
                "listen": {"endpoints": [endpoint]},
                "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
            }
        )
    )
    with zenoh.open(config):
        yield endpoint


@pytest.mark.parametrize("way", ["flags", "variable"])
def test_components_are_clients_of_a_router(start, world, router, way, tmp_path, monkeypatch):
    if way == "variable":
        file = tmp_path / "zenoh.json5"
        file.write_text(json.dumps({"mode": "client", "connect": {"endpoints": [router]}}))
        monkeypatch.setenv("ZENOH_CONFIG", str(file))
        place = ["--name", world]
    else:
        place = ["--name", world, "--connect", router]
    sim = start("sim", *place, "--epochs", 500, "--seed", 2)
    sensors = start("sensors", *place)
    agent = start("agent", *place, "--checkpoint", tmp_path / "c.npz")
    options = BusOptions(name=world, connect=[router])
    with open_session("observer", options) as session, Bus(session, world, "observer", "test") as bus:
        status = wait_status(bus, lambda status: status.phase == "finished", sim, sensors, agent)
    assert agent.stop() == sensors.stop() == sim.stop() == 0
    alone = json.loads(phototaxis("train", "--epochs", 500, "--seed", 2, "--json").stdout)
    assert status.hash == alone["state_hash"]
    assert load(tmp_path / "c.npz")[0].learner_hash == alone["learner_hash"]


def test_a_missing_router_is_one_line(start, world):
    (port,) = free_ports(1)
    process = start("sensors", "--name", world, "--connect", f"tcp/127.0.0.1:{port}")
    assert process.end() == 3
    assert process.stderr.startswith("phototaxis: error: the bus cannot be opened")
    assert process.stderr.count("\n") == 1


def test_a_component_waits_for_its_router_when_asked(start, world):
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    place = "--name", world, "--connect", endpoint
    sim = start("sim", *place, "--wait", DEADLINE)
    deadline = time.monotonic() + DEADLINE
    while sim.stderr != f"waiting up to {DEADLINE:g} s for {endpoint}\n":
        sim.alive()
        assert time.monotonic() < deadline, sim.stderr
    start("router", "--listen", endpoint)
    options = BusOptions(name=world, connect=[endpoint], wait=DEADLINE)
    with open_session("observer", options) as session, Bus(session, world, "observer", "test") as bus:
        wait_status(bus, lambda status: status.phase == "waiting", sim)
    assert sim.stop() == 0
    assert sim.stderr.count("waiting up to") == 1


def test_a_router_that_never_comes_ends_the_wait(world):
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    done = phototaxis("status", "--name", world, "--connect", endpoint, "--wait", 0.2)
    assert done.returncode == 3
    waited, error = done.stderr.splitlines()
    assert waited == f"waiting up to 0.2 s for {endpoint}"
    assert error.startswith("phototaxis: error: the bus cannot be opened")


def test_without_a_simulation_status_says_so(world):
    done = phototaxis("status", "--name", world)
    assert done.returncode == 3
    assert f"no simulation in the world '{world}'; start one with: phototaxis up" in done.stderr


def test_an_open_door_in_a_configuration_file_is_refused(world, tmp_path):
    file = tmp_path / "zenoh.json5"
    file.write_text('{mode: "peer", listen: {endpoints: ["tcp/0.0.0.0:0"]}}')
    done = phototaxis("sim", "--name", world, "--zenoh-config", file)
    assert done.returncode == 2
    assert "listens beyond this machine" in done.stderr
    broken = tmp_path / "broken.json5"
    broken.write_text("{mode: ")
    done = phototaxis("sim", "--name", world, "--zenoh-config", broken)
    assert done.returncode == 2
    assert f"{broken}: not a Zenoh configuration" in done.stderr
