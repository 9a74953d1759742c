"""A component's connection to the bus: it publishes, and receives messages and liveliness changes in one inbox.

Zenoh's callbacks only put items into the inbox. The component's own thread decodes them, so a component is one
loop without locks. A payload that cannot be decoded is refused and counted, and the loop goes on.
"""

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

import zenoh
from zenoh.handlers import Callback

from phototaxis.runtime.machine import STOP, Answer, Ask, Event, Refusal
from phototaxis.runtime.roles import ROLES
from phototaxis.wire.codec import Decoder, Refused, encode
from phototaxis.wire.messages import ControlReply, LogRequest, Message
from phototaxis.wire.topics import TOPICS, Topic, alive_key

QUERY_GRACE_S = 0.5
"""Seconds after a query's timeout in which Zenoh should have ended it."""
REQUEST_TYPES: dict[str, type[Message]] = {"log": LogRequest}


Reach = Callable[[str], AbstractContextManager[zenoh.Session | None]]


class Bus:
    """The topics of one world as one component sees them.

    Parameters
    ----------
    session : an open Zenoh session; the caller closes it.
    name : prefix of the world's keys.
    role : a key of `ROLES`; says which topics are written and read.
    ident : unique name of this component, shown in its liveliness token.
    reach : gives a session in which an agent, named by its ident, can be asked; by default `session`.
    """

    def __init__(self, session: zenoh.Session, name: str, role: str, ident: str, reach: Reach | None = None):
        self.role, self.ident, self.name, self._session = role, ident, name, session
        self._reach: Reach = reach or (lambda _: nullcontext(session))
        self.refused: Counter[str] = Counter()
        self._inbox: SimpleQueue[tuple[str, Any]] = SimpleQueue()
        self._decoders: dict[str, Decoder[Any]] = {}
        self._publishers: dict[str, Any] = {}  # Any here and below: Zenoh's stubs lack return types
        self._declared: list[Any] = []
        self._on_demand: dict[str, Any] = {}
        reads = ROLES[role].reads
        for topic in TOPICS.values():
            if topic.name in reads:
                self._declared.append(self._subscribe(topic))
            if topic.writer == role:
                self._offer(topic)
        watch = self._callback("token")
        self._declared.append(session.liveliness().declare_subscriber(alive_key(name, "*", "*"), watch, history=True))
        self._declared.append(session.liveliness().declare_token(alive_key(name, role, ident)))

    def put(self, topic: str, message: Message | bytes) -> None:
        """Publish one message (or one that is encoded already)."""
        self._publishers[topic].put(message if isinstance(message, bytes) else encode(message))

    def listen(self, topic: str, wanted: bool) -> None:
        """Subscribe to a topic that this role reads on demand, or (`wanted` False) unsubscribe from it."""
        if wanted and topic not in self._on_demand:
            self._on_demand[topic] = self._subscribe(TOPICS[topic])
        elif not wanted and topic in self._on_demand:
            self._on_demand.pop(topic).undeclare()

    def receive(self, timeout: float | None = None) -> Event | None:
        """Return the next event; None if none comes within `timeout` seconds."""
        try:
            source, item = self._inbox.get(timeout=timeout)
        except Empty:
            return None
        if source == "stop":
            return STOP
        if source == "answer":
            return Event("answer", item)
        if source == "token":
            _, role, ident = str(item.key_expr).rsplit("/", 2)
            return Event("alive" if item.kind == zenoh.SampleKind.PUT else "gone", (role, ident))
        try:
            if isinstance(item, zenoh.Query):
                return self._request(source, item)
            return Event(source, self._decoders[source](item.payload.to_bytes()))
        except Refused as why:
            self.refuse(source, str(why))
            return Event("refused", Refusal(source, str(why)))

    def stop(self) -> None:
        """Make `receive` return a "stop" event; may be called from a signal handler or another thread."""
        self._inbox.put(("stop", None))

    def refuse(self, topic: str, why: str) -> None:
        """Count a refused message by topic and kind (the words before the colon); print the first of a kind."""
        reason = f"{topic}: {why.split(':')[0]}"
        if not self.refused[reason]:
            print(f"{self.role}: refused a message on {topic}: {why}", file=sys.stderr, flush=True)
        self.refused[reason] += 1

    def ask(
        self, topic: str, request: Message | None = None, timeout: float = 2.0, session: zenoh.Session | None = None
    ) -> Iterator[bytes]:
        """Send a query on a topic and yield the replies as they arrive; none when nobody answers in time.

        The iterator ends `QUERY_GRACE_S` after the timeout at the latest, even if a queried component has died.
        """
        replies: SimpleQueue[zenoh.Reply | None] = SimpleQueue()
        (session or self._session).get(
            TOPICS[topic].key(self.name),
            handler=Callback(replies.put, lambda: replies.put(None), indirect=False),
            payload=None if request is None else encode(request),
            timeout=timeout,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
        deadline = time.monotonic() + timeout + QUERY_GRACE_S
        while True:
            try:
                reply = replies.get(timeout=max(deadline - time.monotonic(), 0.0))
            except Empty:
                return
            if reply is None:
                return
            if reply.ok is not None:
                yield reply.ok.payload.to_bytes()

    def ask_aside(self, ask: Ask) -> None:
        """Send a query without waiting; its answers arrive as one "answer" event."""
        Thread(target=self._gather, args=(ask,), daemon=True).start()

    def _gather(self, ask: Ask) -> None:
        """Collect the answers to a query and put them into the inbox; runs in a thread of its own."""
        found: list[Message] = []
        decoder = self._answers(ask.topic)
        with suppress(zenoh.ZError), self._reach(ask.agent) if ask.agent else nullcontext(self._session) as session:
            for payload in self.ask(ask.topic, ask.request, ask.timeout, session) if session is not None else ():
                try:
                    found.append(decoder(payload))
                except Refused as why:
                    self.refuse(ask.topic, str(why))
                if found and not ask.every:
                    break
        self._inbox.put(("answer", Answer(ask.tag, found)))

    def ask_agent(self, ident: str, topic: str, request: Message, timeout: float) -> Any:
        """Ask one agent and return its answer; None when the agent is absent or does not answer in time."""
        with self._reach(ident) as session:
            return None if session is None else self.ask_one(topic, request, timeout, session)

    def ask_one(
        self, topic: str, request: Message | None = None, timeout: float = 2.0, session: zenoh.Session | None = None
    ) -> Any:
        """Ask and return the first valid reply; None when none comes in time."""
        decoder = self._answers(topic)
        for payload in self.ask(topic, request, timeout, session):
            try:
                return decoder(payload)
            except Refused as why:
                self.refuse(topic, str(why))
        return None

    def control(self, request: Message, timeout: float = 2.0) -> ControlReply | None:
        """Send a control request to the simulation and return its reply; None when it does not answer."""
        return self.ask_one("control", request, timeout)

    def wait_for(self, role: str, timeout: float) -> bool:
        """Wait for a component of that role, dropping other events; return whether one is on the bus."""
        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0:
            event = self.receive(timeout=left)
            if event is not None and event.topic == "alive" and event.message[0] == role:
                return True
        return False

    def close(self) -> None:
        """Undeclare everything on the bus, the liveliness token last."""
        for declared in [*self._on_demand.values(), *self._publishers.values(), *self._declared]:
            declared.undeclare()

    def __enter__(self) -> "Bus":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _answers(self, topic: str) -> Decoder[Any]:
        """The decoder of the answers to a query."""
        asked = TOPICS[topic]
        return Decoder(asked.reply, asked.reply_limit) if asked.reply else Decoder(asked.message, asked.limit)

    def _subscribe(self, topic: Topic) -> Any:
        self._decoders[topic.name] = Decoder(topic.message, topic.limit)
        session: Any = self._session
        return session.declare_subscriber(topic.key(self.name), self._callback(topic.name))

    def _offer(self, topic: Topic) -> None:
        key = topic.key(self.name)
        if topic.kind in ("stream", "log"):
            steady = topic.kind == "stream"
            self._publishers[topic.name] = self._session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.BLOCK if steady else zenoh.CongestionControl.DROP,
                express=steady,
                priority=zenoh.Priority.DATA if steady else zenoh.Priority.DATA_LOW,
            )
        if topic.kind in ("retained", "log", "query"):
            self._declared.append(self._session.declare_queryable(key, self._callback(topic.name), complete=True))

    def _callback(self, source: str) -> Any:
        put = self._inbox.put

        def keep(item: object) -> None:
            put((source, item))

        return Callback(keep, indirect=False)

    def _request(self, source: str, query: Any) -> Event:
        topic = TOPICS[source]
        kind = topic.message if topic.kind == "query" else REQUEST_TYPES.get(topic.kind)
        payload = b"" if query.payload is None else query.payload.to_bytes()
        message = Decoder(kind, topic.limit)(payload) if kind and payload else None

        def reply(answer: Message | bytes) -> None:
            query.reply(query.key_expr, answer if isinstance(answer, bytes) else encode(answer))

        return Event(source, message, reply)
