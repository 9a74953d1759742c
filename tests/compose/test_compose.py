"""docker compose for real: it comes up, answers where it says, survives kills, swaps the learner, leaves nothing."""

import shutil
import subprocess
import time
import urllib.request
from pathlib import Path

import pytest
from engine import DEADLINE, System, docker
from fmus import Built
from phototaxis.runtime.errors import Unavailable
from phototaxis.runtime.roles import COMPONENTS
from phototaxis.wire.messages import LogRequest, Status
from rerun_files import RERUN, newest_tick

SERVICES = ("router", *COMPONENTS)


def test_it_comes_up_healthy_and_ticks(system: System, capsys: pytest.CaptureFixture[str]):
    sizes = docker(
        "images", "--filter", f"reference=phototaxis-*:{system.name}", "--format", "{{.Repository}} {{.Size}}"
    )
    with capsys.disabled():
        print(f"\n{sizes}" + "\n".join(f"{what}: {seconds:.1f} s" for what, seconds in system.figures.items()))
    with system.bus() as bus:
        for service in SERVICES:
            assert system.inspect(service)["State"]["Health"]["Status"] == "healthy"
        first = system.until(bus, lambda status: status.phase == "running")
        later = system.until(bus, lambda status: status.tick > first.tick + 100)
    assert complete(later)
    assert later.driver.startswith("qtable-")


@pytest.mark.parametrize("service", SERVICES)
def test_least_rights(system: System, service: str):
    found = system.inspect(service)
    host = found["HostConfig"]
    assert found["Config"]["User"] == "10001:10001"
    assert host["ReadonlyRootfs"]
    assert not host["Privileged"]
    assert host["CapDrop"] == ["ALL"]
    assert {place["HostIp"] for bindings in (host["PortBindings"] or {}).values() for place in bindings} <= {
        "127.0.0.1"
    }
    script = "id -u; touch /opt/x 2>/dev/null && echo writable || echo read-only"
    assert system.compose("exec", "-T", service, "/bin/sh", "-c", script).split() == ["10001", "read-only"]


def test_the_page_and_the_stream_answer_on_the_published_ports(system: System, tmp_path: Path):
    page = urllib.request.urlopen(f"http://127.0.0.1:{system.web_port}/", timeout=10)
    assert b"rerun" in page.read().lower()
    file = tmp_path / "live.rrd"
    source = f"rerun+http://127.0.0.1:{system.grpc_port}/proxy"
    with system.bus() as bus:
        now = system.until(bus, lambda status: status.phase == "running")
        viewer = subprocess.Popen([RERUN, "--port", "auto", "--save", file, source], stderr=subprocess.PIPE)
        try:
            deadline = time.monotonic() + DEADLINE
            while (newest := newest_tick(file)) < now.tick:
                assert time.monotonic() < deadline, f"newest tick {newest} of {now.tick}"
                assert viewer.poll() is None, viewer.communicate()
                bus.receive(timeout=0.5)
        finally:
            viewer.terminate()
            viewer.communicate()


@pytest.mark.parametrize("service", ["sensors", "agent", "recorder", "router", "sim"])
def test_what_is_killed_comes_back_and_the_run_goes_on(system: System, service: str):
    with system.bus() as bus:
        before = system.until(bus, lambda status: status.phase == "running")
    container = system.inspect(service)
    # Everything in it but the init; the end of the container may outrun the answer of this shell.
    system.compose("exec", "-T", service, "/bin/sh", "-c", "kill -9 -1", check=False)
    deadline = time.monotonic() + DEADLINE
    while (found := system.inspect(service))["State"]["StartedAt"] == container["State"]["StartedAt"]:
        assert time.monotonic() < deadline, found["State"]
    assert found["RestartCount"] == container["RestartCount"] + 1
    assert found["Id"] == container["Id"]
    while True:
        try:
            with system.bus() as bus:
                system.healthy(bus, service)
                after = system.until(bus, lambda status: complete(status) and status.tick > before.tick)
                break
        except Unavailable:
            assert time.monotonic() < deadline
    assert after.run == before.run


def complete(status: Status) -> bool:
    """The run goes on with all its components."""
    return status.phase == "running" and {who.split("/")[0] for who in status.alive} >= COMPONENTS.keys()


def test_another_learner_takes_the_seat(system: System):
    with system.bus() as bus:
        before = system.until(bus, lambda status: status.driver.startswith("qtable-"))
        system.compose("up", "-d", "--wait", "agent-ann")
        after = system.until(bus, lambda status: status.driver.startswith("ann-") and status.phase == "running")
        later = system.until(bus, lambda status: status.tick > after.tick + 20)
        deadline = time.monotonic() + DEADLINE
        while (old := system.inspect("agent")["State"])["Running"]:
            assert time.monotonic() < deadline
            bus.receive(timeout=0.2)
        assert old["ExitCode"] == 0  # it has handed over and left
    assert later.run == before.run
    assert later.driver == after.driver
    assert [one.how for one in later.drivers][-1] == "took over"


def test_a_sensor_model_from_a_mounted_fmu(system: System, fmu: Built):
    shutil.copy(fmu("lag", 3), system.folder / "fmus" / "lag.fmu")
    with system.bus() as bus:
        before = system.until(bus, complete)
        system.compose("up", "-d", "--wait", "sensors", PHOTOTAXIS_SENSORS_OPTIONS="--light-fmu /fmus/lag.fmu")
        after = system.until(bus, lambda status: complete(status) and status.tick > before.tick + 100)
        assert after.run == before.run
        deadline = time.monotonic() + DEADLINE
        while (log := bus.ask_one("log/sensors", LogRequest())) is None or log.light_model != "lag.fmu":
            assert time.monotonic() < deadline, system.compose("logs", "sensors")


def test_another_arena_is_another_run_and_another_recording(system: System):
    with system.bus() as bus:
        before = system.until(bus, complete)
        system.compose("up", "-d", "--wait", "sim", PHOTOTAXIS_ARENA="doorway")
        after = system.until(bus, lambda status: complete(status) and status.run != before.run and status.tick > 100)
    deadline = time.monotonic() + DEADLINE
    listing = "ls /recordings"
    while f"{after.run}.rrd" not in (found := system.compose("exec", "-T", "recorder", "/bin/sh", "-c", listing)):
        assert time.monotonic() < deadline, found
    assert f"{before.run}.rrd" in found


def test_a_second_project_is_a_second_world(system: System):
    other = system.beside(f"{system.name}-b")
    try:
        other.compose("up", "-d", "--wait")
        with system.bus() as bus, other.bus() as bus_b:
            first, second = system.until(bus, complete), other.until(bus_b, complete)
            assert first.run != second.run
            assert system.until(bus, lambda status: status.tick > first.tick).run == first.run
            assert other.until(bus_b, lambda status: status.tick > second.tick).run == second.run
    finally:
        other.compose("--profile", "*", "down", "--volumes", check=False)


@pytest.mark.parametrize("learner", ["mirror", "dqn"])
def test_the_other_learners_take_the_seat_too(system: System, learner: str):
    with system.bus() as bus:
        system.compose("up", "-d", "--wait", f"agent-{learner}")
        system.until(bus, lambda status: status.driver.startswith(f"{learner}-") and complete(status))


def test_down_leaves_nothing(system: System):
    system.compose("--profile", "*", "down", "--volumes", "--rmi", "all")
    label = f"label=com.docker.compose.project={system.name}"
    for what in (["ps", "-a"], ["network", "ls"], ["volume", "ls"]):
        assert docker(*what, "-q", "--filter", label) == ""
    assert docker("images", "-q", "--filter", f"reference=*:{system.name}") == ""
