"""Makes docs/wire.md, the reference for writing a component in another language, from the tables and Structs."""

import json
import typing
from collections.abc import Iterator
from importlib.resources import files
from itertools import chain
from string import Template
from typing import Any

import msgspec

from phototaxis.guard import rights
from phototaxis.runtime import protocol
from phototaxis.wire import messages, topics

PAGE = files("phototaxis.wire") / "wire.md.in"


def page() -> str:
    """The text of docs/wire.md."""
    defaults = {name: value.default for name, value in _parameters(protocol.RetransmitTimer).items()}
    return Template(PAGE.read_text(encoding="utf-8")).substitute(
        schema=messages.SCHEMA,
        topics=topics.table(),
        limits=_limits(),
        rights=rights.table(),
        messages="\n\n".join(_fields(kind, key) for kind, key in _keys().items()),
        parts="\n\n".join(_fields(kind) for kind in structs(*_keys()) if kind not in _keys()),
        json_schema=json.dumps(_schema(), indent=1),
        first=f"{defaults['first']:g}",
        most=f"{defaults['most']:g}",
    )


def _parameters(kind: type) -> dict[str, Any]:
    from inspect import signature

    return dict(signature(kind).parameters)


def _limits() -> str:
    rows = [
        f"| `{topic.name}` | {topic.limit:,} | {f'{topic.reply_limit:,}' if topic.reply else '–'} |"
        for topic in topics.TOPICS.values()
    ]
    return "\n".join(["| key | largest message or question, bytes | largest answer, bytes |", "|---|--:|--:|", *rows])


def _keys() -> dict[type[msgspec.Struct], str]:
    """The messages of the bus, and the key of each."""
    kinds = [(kind, topic.name) for topic in topics.TOPICS.values() for kind in (topic.message, topic.reply) if kind]
    return {**dict(kinds), messages.LogRequest: "log/…"}


def structs(*kinds: Any) -> list[type[msgspec.Struct]]:
    """All Structs among these types or nested in them, once each, the outer before the inner."""
    return [*dict.fromkeys(chain.from_iterable(map(_inside, kinds)))]


def _inside(kind: Any) -> Iterator[type[msgspec.Struct]]:
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        yield kind
        for field in msgspec.structs.fields(kind):
            yield from _inside(field.type)
    for part in typing.get_args(kind):
        yield from _inside(part)


def _fields(kind: type[msgspec.Struct], key: str = "") -> str:
    from phototaxis.runtime.options import field_help

    texts = field_help(kind)
    rows = [
        f"| `{field.name}` | {_type(field.type)} | {'yes' if field.required else 'no'} | {texts[field.name]} |"
        for field in msgspec.structs.fields(kind)
    ]
    about = " ".join((kind.__doc__ or "").split())
    head = f"### {kind.__name__}{f' (`{key}`)' if key else ''}\n\n{about}\n"
    return "\n".join([head, "| field | type | required | what |", "|---|---|---|---|", *rows])


def _type(kind: Any) -> str:
    """A short description of a field's type, with the words of JSON Schema."""
    found = msgspec.json.schema(kind)
    if "enum" in found:
        return " or ".join(f'`"{one}"`' for one in found["enum"])
    if "$ref" in found:
        return f"[{found['$ref'].rsplit('/', 1)[1]}](#json-schema)"
    if "anyOf" in found:
        return " or ".join(one.get("type", one.get("$ref", "").rsplit("/", 1)[-1]) for one in found["anyOf"])
    words = ["bytes" if "contentEncoding" in found else found.get("type", "any")]
    words += [f"{word} {found[key]}" for key, word in BOUNDS.items() if key in found]
    return ", ".join(words)


BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "from",
    "maximum": "to",
    "minItems": "at least",
    "maxItems": "at most",
    "minLength": "at least",
    "maxLength": "at most",
}


def _schema() -> dict[str, Any]:
    _, components = msgspec.json.schema_components(_keys())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$defs": components}
