"""Finds what a Zenoh configuration opens to other machines. Settings it leaves out are closed; those it sets need
authentication."""

import ipaddress
from collections.abc import Iterator
from typing import Any, NamedTuple

import msgspec
import zenoh

from phototaxis.runtime.errors import UserError

DISCOVERY = ("scouting/multicast/enabled", "scouting/gossip/enabled")
"""Settings by which other machines discover a process and get connected to it. Zenoh enables both by default."""
UNICAST_PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws")
"""Protocols that listen on an address."""
HARMLESS_SECTIONS = frozenset(
    (
        *("id", "metadata", "mode", "region_name", "gateway", "namespace", "open", "connect", "listen", "scouting"),
        *("transport", "access_control", "adminspace", "timestamping", "routing", "aggregation", "qos"),
        *("downsampling", "low_pass_filter", "queries_default_timeout", "stats"),
    )
)
"""Sections of a configuration that open nothing beyond the settings that `exposures` checks."""


class Exposure(NamedTuple):
    """An opening of a Zenoh session to other machines, such as a listener or multicast scouting."""

    what: str
    instead: str
    """What the user can do instead."""
    guarded: bool
    """Whether clients must authenticate, and the access control limits what each of them may do."""


def get(config: zenoh.Config, key: str) -> Any:
    """A value of a configuration; None if it is not set."""
    try:
        return msgspec.json.decode(config.get_json(key))
    except (zenoh.ZError, msgspec.DecodeError):
        return None


def put(config: Any, key: str, value: Any) -> None:
    """Set a value of a configuration. (`Any`: Zenoh's stubs lack the return type.)"""
    config.insert_json5(key, msgspec.json.encode(value).decode())


def endpoints(config: zenoh.Config, what: str) -> list[Any]:
    """The endpoints for `what`, "listen" or "connect", in the configuration's mode."""
    found: list[Any] | dict[str, list[Any] | None] = get(config, f"{what}/endpoints") or []
    return found.get(get(config, "mode") or "peer") or [] if isinstance(found, dict) else found


def close_defaults(config: zenoh.Config) -> None:
    """Close everything that Zenoh would open by default and the configuration does not set.

    Shared memory is always switched off: our messages are too small to gain from it.
    """
    for key in DISCOVERY:
        if get(config, key) is None:
            put(config, key, False)
    if get(config, "listen/endpoints") == get(zenoh.Config(), "listen/endpoints"):
        put(config, "listen/endpoints", [])
    put(config, "transport/shared_memory/enabled", False)


def exposures(config: zenoh.Config) -> Iterator[Exposure]:
    """Everything that a configuration opens to other machines.

    Credentials guard unicast links. They do not guard a multicast group, which has no links, nor a plugin, which
    runs inside the process.
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
            yield Exposure(f"{section} may let other machines in", "leave it out", False)


def refuse_exposures(config: zenoh.Config, source: str = "") -> None:
    """Raise UserError for the first unguarded exposure; `source` names the configuration file."""
    for door in exposures(config):
        if not door.guarded:
            raise UserError(
                f"{source}{': ' if source else ''}{door.what} and nothing guards it; {door.instead}, or a router with "
                f"credentials (phototaxis certs), or add --insecure"
            )


def is_local(endpoint: str) -> bool:
    """Whether only this machine can reach a listener: a Unix socket, or a loopback address on no named interface."""
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
    """Whether only this machine can reach a listener on that name or address."""
    address = _address(host)
    return host == "localhost" if address is None else address.is_loopback


def _multicast(endpoint: str) -> bool:
    address = _address(_host(endpoint))
    return address is not None and address.is_multicast


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """Parse an address, unwrapping an IPv4 address mapped into IPv6; None for a host name."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return None
    return (address.ipv4_mapped or address) if isinstance(address, ipaddress.IPv6Address) else address


def _rights(config: zenoh.Config) -> bool:
    """Whether the access control denies everything to clients without a user name or a certificate."""
    may: dict[str, Any] = get(config, "access_control") or {}
    subjects: list[dict[str, Any]] = may.get("subjects") or []
    named = all(one.get("usernames") or one.get("cert_common_names") for one in subjects)
    return bool(may.get("enabled")) and may.get("default_permission") == "deny" and named
