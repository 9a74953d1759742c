"""What a Zenoh configuration leaves out opens no door, and what it opens needs a guard."""

import json
from pathlib import Path

import pytest
import yaml
import zenoh
from phototaxis.guard import exposure
from phototaxis.guard.router import router_config
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.session import BusOptions, open_router, open_session
from phototaxis_recorder import __main__ as recorder

HERE, ANYWHERE = "tcp/127.0.0.1:0", "tcp/0.0.0.0:0"
SHUT = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}


def config(**sections):
    return zenoh.Config.from_json5(json.dumps(sections))


@pytest.fixture
def file(tmp_path):
    """Writes a Zenoh configuration file; gives the options that name it."""

    def write(insecure=False, **sections):
        path = tmp_path / "zenoh.json5"
        path.write_text(json.dumps(sections))
        return BusOptions(zenoh_config=str(path), insecure=insecure)

    return write


@pytest.mark.parametrize(
    ("endpoint", "local"),
    [
        ("tcp/127.0.0.1:7447", True),
        ("tcp/127.9.9.9:7447", True),
        ("tcp/[::1]:7447", True),
        ("tcp/[::ffff:127.0.0.1]:7447", True),
        ("tls/localhost:7447", True),
        ("tcp/127.0.0.1:7447?rel=1#so_sndbuf=65000", True),
        ("unixsock-stream//run/x/sim", True),
        ("tcp/0.0.0.0:7447", False),
        ("tcp/[::]:7447", False),
        ("tcp/[::ffff:0.0.0.0]:7447", False),
        ("tcp/[::ffff:192.168.1.5]:7447", False),
        ("udp/192.168.1.5:7447", False),
        ("udp/224.0.0.224:7447", False),
        ("udp/127.0.0.1:7447#join=224.0.0.224", False),
        ("tcp/127.0.0.1:7447#iface=eth0", False),
        ("tcp/robot.example:7447", False),
        ("tcp/localhost.example:7447", False),
        ("serial//dev/ttyUSB0#baudrate=9600", False),
        ("vsock/2:7447", False),
        ("carrier-pigeon/127.0.0.1:7447", False),
    ],
)
def test_an_endpoint_is_local_where_only_this_machine_reaches_it(endpoint, local):
    assert exposure.is_local(endpoint) == local
    asked = config(mode="peer", listen={"endpoints": [endpoint]}, scouting=SHUT)
    if local:
        exposure.refuse_exposures(asked)
    else:
        with pytest.raises(UserError, match=r"listens beyond this machine and nothing guards it; .* --insecure"):
            exposure.refuse_exposures(asked)


@pytest.mark.parametrize("mode", ["peer", "router", "client"])
def test_what_a_file_leaves_out_is_shut(mode):
    left = config(mode=mode)
    exposure.close_defaults(left)
    for key in (*exposure.DISCOVERY, "transport/shared_memory/enabled"):
        assert exposure.get(left, key) is False
    assert exposure.endpoints(left, "listen") == []
    assert list(exposure.exposures(left)) == []


@pytest.mark.parametrize(
    ("sections", "door"),
    [
        ({"listen": {"endpoints": [ANYWHERE]}}, "tcp/0.0.0.0:0 listens"),
        ({"listen": {"endpoints": {"peer": [ANYWHERE]}}}, "tcp/0.0.0.0:0 listens"),
        ({"mode": "client", "listen": {"endpoints": [ANYWHERE]}}, "tcp/0.0.0.0:0 listens"),
        ({"listen": {"endpoints": [HERE, "udp/224.0.0.224:7449"]}}, "udp/224.0.0.224:7449 listens"),
        ({"scouting": {"multicast": {"enabled": True}}}, "scouting/multicast/enabled"),
        ({"scouting": {"gossip": {"enabled": True}}}, "scouting/gossip/enabled"),
        ({"adminspace": {"enabled": True, "permissions": {"write": True}}}, "adminspace/permissions/write"),
        ({"plugins": {"rest": {"http_port": 8000}}}, "plugins may let other machines in"),
        ({"plugins_loading": {"enabled": True}}, "plugins_loading may let other machines in"),
    ],
)
def test_a_door_that_a_file_asks_for_is_refused_by_name(file, sections, door):
    sections = {"listen": {"endpoints": [HERE]}, **sections}
    options = file(**sections)
    with pytest.raises(UserError, match=door) as refused:
        open_session("sim", options)
    assert str(refused.value).startswith(options.zenoh_config)


def test_on_request_a_file_may_open_a_door_and_no_other(file):
    asked = {"listen": {"endpoints": [HERE]}, "scouting": {"gossip": {"enabled": True}}}
    open_session("sim", file(True, **asked)).close()
    kept = config(**asked)
    exposure.close_defaults(kept)
    assert exposure.get(kept, "scouting/gossip/enabled") is True
    assert exposure.get(kept, "scouting/multicast/enabled") is False


@pytest.mark.parametrize("mode", ["peer", "client", None])
def test_a_file_that_leads_nowhere_is_refused(file, mode):
    with pytest.raises(UserError, match="names no endpoint to listen on or to connect to"):
        open_session("sim", file(mode=mode))
    with pytest.raises(UserError, match=r"not the configuration of a router|names no endpoint"):
        open_router(file(mode=mode, connect={"endpoints": [HERE]}))


@pytest.mark.parametrize("auth", ["mtls", "password"])
def test_credentials_guard_a_listener(tmp_path, auth):
    made = router_config(["a"], ["tls/0.0.0.0:7447"], tmp_path, auth)
    exposure.refuse_exposures(config(**made))
    may = {**made["access_control"], "subjects": [*made["access_control"]["subjects"], {"id": "anybody"}]}
    for weaker in (
        {"access_control": {**made["access_control"], "default_permission": "allow"}},
        {"access_control": {**made["access_control"], "enabled": False}},
        {"access_control": may},
        {"transport": {}},
        {"listen": {"endpoints": ["udp/224.0.0.224:7447"]}},
        {"plugins": {"rest": {"http_port": 8000}}},
    ):
        with pytest.raises(UserError, match="nothing guards it"):
            exposure.refuse_exposures(config(**{**made, **weaker}))


def test_certificates_guard_no_plain_listener(tmp_path):
    for endpoint in (ANYWHERE, "tls/0.0.0.0:7447#enable_mtls=false"):
        with pytest.raises(UserError, match="nothing guards it"):
            exposure.refuse_exposures(config(**router_config(["a"], [endpoint], tmp_path, "mtls")))


def test_every_section_of_zenoh_has_been_looked_at():
    assert json.loads(str(zenoh.Config())).keys() - exposure.HARMLESS_SECTIONS == {"plugins", "plugins_loading"}


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.168.1.5", "robot.example", ""])  # noqa: S104 - is refused
def test_who_watches_is_no_stranger_either(address):
    with pytest.raises(UserError, match=f"--bind {address}: others could watch"):
        recorder.main([f"--bind={address}", "--output=/nowhere/at/all.rrd"])


def test_the_compose_file_opens_ports_of_this_machine_alone():
    services = yaml.safe_load((Path(__file__).parents[2] / "deploy/compose.yaml").read_text())["services"]
    shut = {"--no-multicast-scouting", "--cfg=scouting/gossip/enabled:false", "--adminspace-permissions=none"}
    assert shut < set(services["router"]["command"])
    for service in services.values():
        assert all(port.startswith("127.0.0.1:") for port in service.get("ports", []))
