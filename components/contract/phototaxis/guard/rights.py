"""Who may write and read what, for a router that guards the bus: generated from the tables of topics and roles.

A component's name at the router is WORLD.ROLE: its user name, or the common name of its certificate.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from phototaxis.runtime.roles import ROLES
from phototaxis.wire.topics import TOPICS, alive_key

MAX_KEY_BYTES = 256


class Rights(NamedTuple):
    """What one role may do, as names of topics."""

    writes: list[str]
    """It publishes them."""
    reads: list[str]
    """It subscribes to them."""
    answers: list[str]
    """It is asked for them."""
    asks: list[str]
    """It asks for them."""


def rights(role: str) -> Rights:
    """What a role may do."""
    own = [topic for topic in TOPICS.values() if topic.writer == role]
    read = *ROLES[role].reads, *ROLES[role].on_demand
    return Rights(
        writes=[topic.name for topic in own if topic.kind in ("stream", "log")],
        reads=list(read),
        answers=[topic.name for topic in own if topic.kind != "stream"],
        asks=[*ROLES[role].asks, *(name for name in read if TOPICS[name].kind == "log")],
    )


def subject(world: str, role: str) -> str:
    """A component's name at the router."""
    return f"{world}.{role}"


def access_control(worlds: Sequence[str]) -> dict[str, Any]:
    """The `access_control` section of a router's Zenoh configuration: what is not allowed is denied."""
    rules: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for world in worlds:
        for role in ROLES:
            name = subject(world, role)
            made = [{"id": f"{name} {rule['id']}", **_without_id(rule)} for rule in _rules(world, role)]
            rules += made
            subjects += [
                {"id": f"{name} by password", "usernames": [name]},
                {"id": f"{name} by certificate", "cert_common_names": [name]},
            ]
            who = [f"{name} by password", f"{name} by certificate"]
            policies.append({"rules": [rule["id"] for rule in made], "subjects": who})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def low_pass_filter(worlds: Sequence[str]) -> list[dict[str, Any]]:
    """The `low_pass_filter` section: larger messages than a topic's limit do not pass."""
    found: list[dict[str, Any]] = []
    for world in worlds:
        for topic in TOPICS.values():
            sizes = {"put": topic.limit, "query": topic.limit, "reply": topic.reply_limit or topic.limit}
            for message, size in sizes.items():
                found.append(
                    {
                        "id": f"{world} {topic.name} {message}",
                        "flows": ["ingress"],
                        "messages": [message],
                        "key_exprs": [topic.key(world)],
                        "size_limit": size,
                    }
                )
    return found


def table() -> str:
    """Who may do what, as a Markdown table."""
    rows: list[str] = []
    for role in ROLES:
        cells = [", ".join(names) or "–" for names in rights(role)]
        rows.append(f"| {role} | {' | '.join(cells)} |")
    return "\n".join(["| role | writes | reads | answers | asks |", "|---|---|---|---|---|", *rows])


def _rules(world: str, role: str) -> Iterator[dict[str, Any]]:
    """Ingress is what the component sends to the router, egress what the router sends to it."""
    may = rights(role)
    for what, names, ingress, egress in (
        ("writes", may.writes, ["put"], ["declare_subscriber"]),
        ("reads", may.reads, ["declare_subscriber"], ["put"]),
        ("answers", may.answers, ["declare_queryable", "reply"], ["query"]),
        ("asks", may.asks, ["query"], ["declare_queryable", "reply"]),
    ):
        keys = [TOPICS[name].key(world) for name in names]
        if keys:
            yield _rule(f"{what}, sent", ingress, "ingress", keys)
            yield _rule(f"{what}, received", egress, "egress", keys)
    yield _rule("is here", ["liveliness_token"], "ingress", [alive_key(world, role, "*")])
    everyone = [alive_key(world, "*", "*")]
    yield _rule("sees who is here", ["declare_liveliness_subscriber", "liveliness_query"], "ingress", everyone)
    yield _rule("is told who is here", ["liveliness_token", "reply"], "egress", everyone)


def _rule(name: str, messages: list[str], flow: str, keys: list[str]) -> dict[str, Any]:
    return {"id": name, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": keys}


def _without_id(rule: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in rule.items() if key != "id"}
