"""What each topic's payloads are decoded by, made once, as on the bus."""

from typing import Any

from phototaxis.wire.codec import Decoder
from phototaxis.wire.messages import LogRequest
from phototaxis.wire.topics import TOPICS

DECODERS = {topic.name: Decoder(topic.message, topic.limit) for topic in TOPICS.values()}
ANSWERS = {t.name: Decoder(t.reply, t.reply_limit) if t.reply else DECODERS[t.name] for t in TOPICS.values()}
REQUESTS: dict[str, Decoder[Any]] = {
    topic.name: DECODERS[topic.name] if topic.kind == "query" else Decoder(LogRequest, topic.limit)
    for topic in TOPICS.values()
    if topic.kind in ("query", "log")
}
