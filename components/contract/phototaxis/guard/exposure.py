"""What a Zenoh configuration opens to strangers: what it leaves out is shut, what it asks for needs a guard."""

import ipaddress
from collections.abc import Iterator
from typing import Any, NamedTuple

import msgspec
import zenoh

from phototaxis.runtime.errors import UserError

DISCOVERY = ("scouting/multicast/enabled", "scouting/gossip/enabled")
"""How strangers find a process and are dialled by it, whatever it listens on. Zenoh has both on by default."""
UNICAST_PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws")
"""Protocols that listen on an address."""
HARMLESS_SECTIONS = frozenset(
    (
        *("id", "metadata", "mode", "region_name", "gateway", "namespace", "open", "connect", "listen", "scouting"),
        *("transport", "access_control", "adminspace", "timestamping", "routing", "aggregation", "qos"),
        *("downsampling", "low_pass_filter", "queries_default_timeout", "stats"),
    )
)
"""Sections of a configuration that open nothing, apart from what `exposures` looks into."""


class Exposure(NamedTuple):
    """An opening of a Zenoh session to other machines, such as a listener or multicast scouting."""

    what: str
    instead: str
    """What to do in place of it."""
    guarded: bool
    """Whether clients must authenticate, and the access control limits what each of them may do."""


def get(config: zenoh.Config, key: str) -> Any:
    """A value of a configuration; None where there is none."""
    try:
        return msgspec.json.decode(config.get_json(key))
    except (zenoh.ZError, msgspec.DecodeError):
        return None


def put(config: Any, key: str, value: Any) -> None:
    """Set a value of a configuration, whose stubs do not say that this returns nothing."""
    config.insert_json5(key, msgspec.json.encode(value).decode())


def endpoints(config: zenoh.Config, what: str) -> list[Any]:
    """The endpoints to "listen" on (texts) or to "connect" to, in the mode that the configuration has."""
    found: list[Any] | dict[str, list[Any] | None] = get(config, f"{what}/endpoints") or []
    return found.get(get(config, "mode") or "peer") or [] if isinstance(found, dict) else found


def close_defaults(config: zenoh.Config) -> None:
    """Set what the configuration leaves out, and what Zenoh would open then, to what opens nothing.

    Shared memory goes off in any case: messages of our size gain nothing by it.
    """
    for key in DISCOVERY:
        if get(config, key) is None:
            put(config, key, False)
    if get(config, "listen/endpoints") == get(zenoh.Config(), "listen/endpoints"):
        put(config, "listen/endpoints", [])
    put(config, "transport/shared_memory/enabled", False)


def exposures(config: zenoh.Config) -> Iterator[Exposure]:
    """The doors that a configuration asks for.

    Credentials guard links to an address. They do not guard a multicast group, which has no links, nor a
    plugin, which is inside already.
    """
    rights = _rights(config)
    passwords = rights and bool(get(config, "transport/auth/usrpwd/dictionary_file"))
    certificates = rights and get(config, "transport/link/tls/enable_mtls") is True
    for endpoint in endpoints(config, "listen"):
        if not is_local(endpoint):
            protocol = endpoint.partition("/")[0]
            certified = certificates and protocol in ("tls", "quic") and "enable_mtls" not in endpoint
            guarded = protocol in UNICAST_PROTOCOLS and not _multicast(endpoint) and (passwords or certified)
            yield Exposure(f"{endpoint} listens beyond this machine", "use 127.0.0.1", guarded)
    for key in DISCOVERY:
        if get(config, key) is True:
            yield Exposure(f"{key} lets strangers find this process", "leave it out", passwords or certificates)
    if get(config, "adminspace/enabled") and get(config, "adminspace/permissions/write"):
        what = "adminspace/permissions/write lets others change this configuration"
        yield Exposure(what, "leave it out", passwords or certificates)
    defaults = msgspec.json.decode(str(zenoh.Config()))
    for section, value in msgspec.json.decode(str(config)).items():
        if section not in HARMLESS_SECTIONS and value != defaults.get(section):
            yield Exposure(f"{section} may open doors of its own", "leave it out", False)


def refuse_exposures(config: zenoh.Config, source: str = "") -> None:
    """Raise UserError for the first open door that nothing guards; `source` names the file."""
    for door in exposures(config):
        if not door.guarded:
            raise UserError(
                f"{source}{': ' if source else ''}{door.what} and nothing guards it; {door.instead}, or a router with "
                f"credentials (phototaxis certs), or add --insecure"
            )


def is_local(endpoint: str) -> bool:
    """Whether only this machine reaches a listener: a Unix socket, or a loopback address on no named interface."""
    protocol, _, rest = endpoint.partition("/")
    if protocol == "unixsock-stream":
        return True
    extra = rest.partition("#")[2]
    bound = any(word.startswith(("iface=", "join=")) for word in extra.split(";"))
    return protocol in UNICAST_PROTOCOLS and not bound and is_loopback(_host(endpoint))


def _host(endpoint: str) -> str:
    address = endpoint.partition("/")[2].partition("#")[0].partition("?")[0]
    return address.rpartition(":")[0].strip("[]")


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches what listens on that name or address."""
    address = _address(host)
    return host == "localhost" if address is None else address.is_loopback


def _multicast(endpoint: str) -> bool:
    address = _address(_host(endpoint))
    return address is not None and address.is_multicast


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """An address, that of IPv4 where it stands within one of IPv6; None for a name."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return None
    return (address.ipv4_mapped or address) if isinstance(address, ipaddress.IPv6Address) else address


def _rights(config: zenoh.Config) -> bool:
    """Whether a stranger may do nothing: all is denied but what is allowed to names and certificates."""
    may: dict[str, Any] = get(config, "access_control") or {}
    subjects: list[dict[str, Any]] = may.get("subjects") or []
    named = all(one.get("usernames") or one.get("cert_common_names") for one in subjects)
    return bool(may.get("enabled")) and may.get("default_permission") == "deny" and named
