"""A guarded router: who comes in, and what each may do there; with real sessions and certificates."""

import json
import stat
import time
from pathlib import Path
from typing import Any

import pytest
import zenoh
from phototaxis.guard.router import client_config, router_config
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.ports import free_ports
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis_lab import check
from phototaxis_launcher import certs as certs_command
from support import Process, command, phototaxis, wait_status

WORLDS = ("a", "b")
ANYWHERE = "0.0.0.0"  # noqa: S104 - what is tried is that this needs credentials


@pytest.fixture(scope="module")
def certs(tmp_path_factory):
    """Certificates for two worlds, and the port of their router."""
    (port,), folder = free_ports(1), tmp_path_factory.mktemp("guard") / "certs"
    done = phototaxis("certs", "--out", folder, "--worlds", ",".join(WORLDS), "--port", port)
    assert done.returncode == 0, done.stderr
    return folder, port


@pytest.fixture(params=["mtls", "password"])
def guarded(request, start, certs):
    """A running router; gives the configuration file of a component."""
    folder, _ = certs
    router = start("router", "--zenoh-config", folder / f"router-{request.param}.json5")
    deadline = time.monotonic() + 20
    while "is up" not in router.stderr:
        router.alive()
        assert time.monotonic() < deadline

    def place(role: str, world: str = "a") -> tuple[str, str]:
        return "--zenoh-config", str(folder / f"{world}.{role}.{request.param}.json5")

    place.router, place.auth = router, request.param  # type: ignore[attr-defined] - the tests ask the function for both
    return place


def session(place, role: str, world: str = "a") -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_file(place(role, world)[1]))


def somebody_listens(publisher: zenoh.Publisher) -> bool:
    status: Any = publisher.matching_status
    return status.matching


def test_a_run_through_the_guarded_router_is_the_same(start, guarded, tmp_path):
    words = ("--epochs", 600, "--seed", 2)
    sim = start("sim", "--name", "a", *guarded("sim"), *words)
    sensors = start("sensors", "--name", "a", *guarded("sensors"))
    place = ("agent", "--name", "a", *guarded("agent"))
    second = start(*place, "--take-over", "--at", 300, "--ident", "second", "--checkpoint", tmp_path / "c.npz")
    options = BusOptions(name="a", zenoh_config=guarded("observer")[1])
    with open_session("observer", options) as observing, Bus(observing, "a", "observer", "test") as bus:
        wait_status(bus, lambda status: status.next == ["second"], sim, sensors, second)
        first = start(*place, "--ident", "first")
        status = wait_status(bus, lambda status: status.phase == "finished", sim, sensors, second)
        assert [(one.driver, one.tick) for one in status.drivers] == [("first", 0), ("second", 300)]
        assert first.end() == 0
    assert second.stop() == sensors.stop() == sim.stop() == 0
    alone = json.loads(phototaxis("train", *words, "--json").stdout)
    assert status.hash == alone["state_hash"]
    assert load(tmp_path / "c.npz")[0].learner_hash == alone["learner_hash"]


def test_who_cannot_say_who_it_is_stays_outside(guarded, certs, tmp_path):
    folder, port = certs
    good = json.loads("".join(Path(guarded("agent")[1]).read_text().splitlines(keepends=True)[1:]))
    nobody = client_config(f"tls/localhost:{port}", folder, "a.agent", "password", "guess")
    nobody["connect"]["timeout_ms"] = 1000
    none = json.loads(json.dumps(nobody))
    del none["transport"]["auth"]
    strangers = {"wrong password or no certificate": nobody, "nothing": none}
    if guarded.auth == "mtls":
        other = tmp_path / "other"
        assert phototaxis("certs", "--out", other, "--worlds", "a").returncode == 0
        forged = json.loads(json.dumps(good))
        tls = forged["transport"]["link"]["tls"]
        tls["connect_certificate"], tls["connect_private_key"] = str(other / "a.agent.pem"), str(other / "a.agent.key")
        strangers["another authority's certificate"] = forged
    for who, config in strangers.items():
        config["connect"]["timeout_ms"] = 1000
        file = tmp_path / "stranger.json5"
        file.write_text(json.dumps(config))
        done = phototaxis("agent", "--name", "a", "--zenoh-config", file)
        assert done.returncode == 3, who
        assert "rejected our credentials" in done.stderr
        assert done.stderr.count("\n") == 1
        with pytest.raises(zenoh.ZError):
            zenoh.open(zenoh.Config.from_file(str(file)))


def test_an_agent_with_good_credentials_can_do_what_an_agent_does_and_no_more(guarded):
    heard: list[tuple[str, int]] = []

    def hear(sample: zenoh.Sample) -> None:
        heard.append((str(sample.key_expr), len(sample.payload)))

    with (
        session(guarded, "agent") as agent,
        session(guarded, "agent") as spy,
        session(guarded, "sim") as sim,
        session(guarded, "sim", "b") as elsewhere,
        session(guarded, "sensors") as sensors,
        session(guarded, "observer") as observer,
    ):
        for owner, key in ((sim, "a/command"), (elsewhere, "b/command"), (sensors, "a/state"), (observer, "a/status")):
            owner.declare_subscriber(key, hear)
        spy.declare_subscriber("a/status", hear)
        spy.declare_subscriber("b/**", hear)
        mine = agent.declare_publisher("a/command")
        others = [agent.declare_publisher(key) for key in ("a/state", "b/command", "a/status")]
        deadline = time.monotonic() + 10
        while not somebody_listens(mine):
            assert time.monotonic() < deadline
        for forbidden in others:
            assert not somebody_listens(forbidden)  # the intruder sees that nobody listens to it
            forbidden.put(b"forged")
        mine.put(b"0" * 1_000_000)
        sim.put("a/status", b"status")
        elsewhere.put("b/state", b"elsewhere")
        mine.put(b"good")
        while ("a/command", 4) not in heard or ("a/status", 6) not in heard:
            assert time.monotonic() < deadline, heard
        assert sorted(heard) == [("a/command", 4), ("a/status", 6)]  # the observer's, not the agent's
        assert not list(agent.get("a/launch", payload=b"{}", timeout=0.5))


def test_the_shipped_configuration_and_page_are_those_of_the_tables(tmp_path):
    done = phototaxis("check", "rights")
    assert done.returncode == 0, done.stderr
    assert "| agent | command, batch/command, log/agent | readings, batch/readings |" in done.stdout
    assert phototaxis("check", "wire").returncode == 0
    file = tmp_path / "router.json5"
    assert phototaxis("check", "rights", "--file", file, "--worlds", "a,b", "--write").returncode == 0
    assert phototaxis("check", "rights", "--file", file, "--worlds", "a,b").returncode == 0
    file.write_text(file.read_text().replace('"declare_queryable"', '"put"', 1))
    wrong = phototaxis("check", "rights", "--file", file, "--worlds", "a,b")
    assert wrong.returncode == 2
    assert "access_control differ" in wrong.stderr


@pytest.mark.parametrize(
    ("mended", "line"),
    [
        ('"scouting": {}', "scouting/multicast/enabled is left out, and zenohd turns it on"),
        ('"scouting": {"multicast": {"enabled": false}}', "scouting/gossip/enabled is left out"),
        ('"plugins": {"rest": {}}, "scouting": {}', "plugins may let other machines in and nothing guards it"),
    ],
)
def test_a_configuration_with_the_right_rights_and_an_open_door_is_refused(tmp_path, mended, line):
    made = router_config(["a"], ["tls/0.0.0.0:7447"], tmp_path, "mtls")
    file = tmp_path / "router.json5"
    file.write_text(json.dumps(made).replace(f'"scouting": {json.dumps(made["scouting"])}', mended))
    with pytest.raises(UserError, match=line):
        check.main(["rights", "--file", str(file), "--worlds", "a"])


def test_what_the_router_cannot_be_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words, line in (("--host=::1", "names and IPv4 addresses"), ("--worlds=a,..", "--worlds a,..")):
        with pytest.raises(UserError, match=line):
            certs_command.main([words])
    assert list(tmp_path.iterdir()) == []
    certs_command.main(["--listen=::1", "--worlds=a,a"])
    router = json.loads("".join(Path("certs/router-mtls.json5").read_text().splitlines()[1:]))
    assert router["listen"]["endpoints"] == ["tls/[::1]:7447"]


def test_keys_and_passwords_are_for_their_owner_alone_and_nothing_is_overwritten(certs):
    folder, _ = certs
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(file.stat().st_mode) for file in folder.iterdir()} == {0o600}
    again = phototaxis("certs", "--out", folder)
    assert again.returncode == 2
    assert "exists already" in again.stderr


def test_a_router_beyond_this_machine_needs_credentials(start, tmp_path):
    done = phototaxis("router", "--listen", f"tcp/{ANYWHERE}:{free_ports(1)[0]}")
    assert done.returncode == 2
    assert "nothing guards it" in done.stderr
    folder = tmp_path / "certs"
    assert phototaxis("certs", "--out", folder, "--listen", ANYWHERE, "--port", *free_ports(1)).returncode == 0
    router: Process = start("router", "--zenoh-config", folder / "router-mtls.json5")
    deadline = time.monotonic() + 20
    while "is up" not in router.stderr:
        router.alive()
        assert time.monotonic() < deadline
    assert router.stop() == 0
    file = folder / "router-mtls.json5"
    file.write_text(file.read_text().replace('"default_permission": "deny"', '"default_permission": "allow"'))
    assert phototaxis("router", "--zenoh-config", file).returncode == 2
    assert phototaxis("router").returncode == 2


def test_a_successor_in_another_network_inherits_through_the_guarded_router(namespace, start, tmp_path):
    enter, address = namespace
    certs, words = tmp_path / "certs", ("--epochs", 600, "--seed", 2)
    made = phototaxis("certs", "--out", certs, "--worlds", "a", "--host", address, "--listen", address, "--port", 7447)
    assert made.returncode == 0, made.stderr
    start("router", "--zenoh-config", certs / "router-mtls.json5")

    def place(role: str) -> tuple[object, ...]:
        return role, "--name", "a", "--zenoh-config", certs / f"a.{role}.mtls.json5"

    sim, sensors = start(*place("sim"), *words), start(*place("sensors"))
    remote = (*place("agent"), "--take-over", "--at", 300, "--ident", "remote", "--checkpoint", tmp_path / "c.npz")
    second = start("remote", argv=[*enter, *command(*remote)])
    options = BusOptions(name="a", zenoh_config=str(certs / "a.observer.mtls.json5"))
    with open_session("observer", options) as observing, Bus(observing, "a", "observer", "test") as bus:
        wait_status(bus, lambda status: status.next == ["remote"], sim, sensors, second)
        start(*place("agent"), "--ident", "near")
        status = wait_status(bus, lambda status: status.phase == "finished", sim, sensors, second)
    assert [one.driver for one in status.drivers] == ["near", "remote"]
    alone = json.loads(phototaxis("train", *words, "--json").stdout)
    assert status.hash == alone["state_hash"]
    assert load(tmp_path / "c.npz")[0].learner_hash == alone["learner_hash"]
