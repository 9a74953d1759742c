"""Encodes and decodes messages; refuses payloads that are too large, malformed or of another schema."""

from typing import Any, Generic, TypeVar

import msgspec
from msgspec import Struct

from phototaxis.wire.messages import SCHEMA, Message


class Refused(Exception):
    """A message is not accepted. The text is the kind of reason, a colon, and the details."""


M = TypeVar("M", bound=Message)


class _Header(Struct):
    schema: int = SCHEMA


encode = msgspec.msgpack.Encoder().encode


class Decoder(Generic[M]):
    """Decodes one message type from MessagePack or JSON, and raises `Refused` for an invalid payload."""

    def __init__(self, kind: type[M], limit: int):
        self._limit = limit
        self._msgpack = msgspec.msgpack.Decoder(kind)
        self._json = msgspec.json.Decoder(kind)

    def __call__(self, payload: bytes) -> M:
        if len(payload) > self._limit:
            raise Refused(f"oversized: {len(payload)} bytes, at most {self._limit}")
        decoder: Any = self._json if payload[:1] == b"{" else self._msgpack
        try:
            message = decoder.decode(payload)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise Refused(_why(payload, error)) from None
        if message.schema != SCHEMA:
            raise Refused(f"schema: theirs is {message.schema}, ours {SCHEMA}")
        return message


def _why(payload: bytes, error: Exception) -> str:
    """The clearest reason for a failed decode: the schema version first, then the field."""
    header = msgspec.json.decode if payload[:1] == b"{" else msgspec.msgpack.decode
    try:
        schema = header(payload, type=_Header).schema
    except Exception:
        return f"malformed: {error}"
    return f"schema: theirs is {schema}, ours {SCHEMA}" if schema != SCHEMA else f"invalid: {error}"
