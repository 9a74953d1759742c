"""Generates the access rules of a guarded router, which say which role may write and read which topic.

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
    """Topics that the role publishes."""
    reads: list[str]
    """Topics that the role subscribes to."""
    answers: list[str]
    """Topics on which the role answers queries."""
    asks: list[str]
    """Topics on which the role sends queries."""


def rights(role: str) -> Rights:
    """The rights of a role, from `TOPICS` and `ROLES`."""
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
    """The `access_control` section of a router's Zenoh configuration, which denies everything else."""
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
    """The `low_pass_filter` section: the router drops messages larger than their topic's limit."""
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
    """The rights of all roles as a Markdown table, for the documentation."""
    rows: list[str] = []
    for role in ROLES:
        cells = [", ".join(names) or "–" for names in rights(role)]
        rows.append(f"| {role} | {' | '.join(cells)} |")
    return "\n".join(["| role | writes | reads | answers | asks |", "|---|---|---|---|---|", *rows])


def _rules(world: str, role: str) -> Iterator[dict[str, Any]]:
    """The rules of a role. Ingress is from the component to the router, egress from the router to the component."""
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
