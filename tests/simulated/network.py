"""The simulated network: streams, queries and liveliness tokens in virtual time, with faults drawn from a seed.

Every message is encoded by its sender and decoded by each receiver, as on the bus.
"""

from collections.abc import Callable
from random import Random
from typing import Any

import msgspec
from phototaxis.runtime.machine import Answer, Ask, Event
from phototaxis.runtime.roles import ROLES
from phototaxis.wire.codec import Refused, encode
from phototaxis.wire.messages import Message
from phototaxis.wire.topics import TOPICS

from simulated.decoders import ANSWERS
from simulated.process import Process
from simulated.timeline import Timeline


class Weather(msgspec.Struct, kw_only=True):
    """What the network does to messages of streams; queries may be lost, and liveliness tokens are late at most."""

    latency: float = 0.001
    """Seconds; each message takes between half and one and a half of it. One link keeps the order of its messages."""
    loss: float = 0.0
    """Share of the messages that are lost."""
    query_loss: float = 0.0
    """The same of queries and of their answers, which a link loses only when it breaks."""
    double: float = 0.0
    """Share that comes twice."""
    reorder: float = 0.0
    """Share that is delayed by up to 20 latencies and overtaken by later ones."""


class Query:
    """One question on its way: it ends with its first answer, or by its timeout."""

    def __init__(self, network: "Network", asker: Process, ask: Ask):
        self._network, self._asker, self._ask = network, asker, ask
        self._found: list[Any] = []
        self._over = False

    def send(self) -> None:
        """Ask everybody who may answer; where nobody is, the empty answer comes at once."""
        topic, wanted, network = TOPICS[self._ask.topic], self._ask.agent, self._network
        asked = [
            one
            for one in network.processes
            if one.role == topic.writer and wanted in ("", one.ident) and not network.parted(self._asker, one)
        ]
        network.timeline.after(self._ask.timeout if asked else 0.0, self._end)
        payload = b"" if self._ask.request is None else encode(self._ask.request)
        for one in asked:
            network.send(
                self._asker, one, "request", (topic.name, payload, lambda answer, one=one: self._reply(one, answer))
            )

    def _reply(self, writer: Process, answer: Message | bytes) -> None:
        payload = answer if isinstance(answer, bytes) else encode(answer)
        self._network.send(writer, self._asker, "reply", (self, payload))

    def heard(self, payload: bytes) -> None:
        """An answer has come."""
        try:
            self._found.append(ANSWERS[self._ask.topic](payload))
        except Refused:
            return
        if not self._ask.every:
            self._end()

    def _end(self) -> None:
        if not self._over:
            self._over = True
            self._asker.deliver("event", Event("answer", Answer(self._ask.tag, self._found)))


class Network:
    """Who is on the bus, and what becomes of each message.

    Attributes
    ----------
    weather : the faults that prevail now.
    counts : how many messages were sent, lost, doubled and reordered, or met a link that was cut.
    cuts : each says of two processes whether their link is cut now.
    """

    def __init__(self, timeline: Timeline, rng: Random, weather: Weather | None = None):
        self.timeline, self.weather, self._rng = timeline, weather or Weather(), rng
        self.processes: list[Process] = []
        self.counts = {"sent": 0, "lost": 0, "doubled": 0, "reordered": 0, "cut off": 0}
        self.cuts: list[Callable[[Process, Process], bool]] = []
        self._last: dict[tuple[str, str], float] = {}

    def join(self, process: Process) -> None:
        """A process comes: it hears who is there, and they hear of it."""
        for other in self.processes:
            self._token(process, other, "alive")
            self._token(other, process, "alive")
        self.processes.append(process)

    def leave(self, process: Process) -> None:
        """A process is gone: what it has sent still arrives, then its token vanishes."""
        if process in self.processes:
            self.processes.remove(process)
            for other in self.processes:
                self._token(process, other, "gone")

    def parted(self, one: Process, other: Process) -> bool:
        """Whether nothing passes between the two."""
        return any(cut(one, other) for cut in self.cuts)

    def part(self, cut: Callable[[Process, Process], bool]) -> None:
        """Cut links: each side sees the tokens of the other vanish."""
        self._change("gone", lambda: self.cuts.append(cut))

    def mend(self, cut: Callable[[Process, Process], bool]) -> None:
        """Undo a cut: tokens come back where no other cut remains."""
        self._change("alive", lambda: self.cuts.remove(cut))

    def _change(self, what: str, change: Callable[[], None]) -> None:
        pairs = [(one, other) for one in self.processes for other in self.processes if one is not other]
        before = [self.parted(*pair) for pair in pairs]
        change()
        for (one, other), was in zip(pairs, before, strict=True):
            if self.parted(one, other) != was:
                self._deliver_in_order(one, other, "event", Event(what, (one.role, one.ident)))

    def publish(self, sender: Process, topic: str, payload: bytes) -> None:
        """To all who read the topic."""
        for one in self.processes:
            if topic in ROLES[one.role].reads or topic in one.listens:
                self.send(sender, one, "message", (topic, payload))

    def ask(self, asker: Process, ask: Ask) -> None:
        """Send a query."""
        Query(self, asker, ask).send()

    def send(self, sender: Process, to: Process, kind: str, item: Any) -> None:
        """One message on one link: lost, doubled, overtaken, or in order."""
        weather, draw = self.weather, self._rng.random
        self.counts["sent"] += 1
        if self.cuts and self.parted(sender, to):
            self.counts["cut off"] += 1
            return
        stream = kind == "message"
        if draw() < (weather.loss if stream else weather.query_loss):
            self.counts["lost"] += 1
            return
        if stream and draw() < weather.reorder:
            self.counts["reordered"] += 1
            self._deliver_late(to, kind, item)
        else:
            self._deliver_in_order(sender, to, kind, item)
        if stream and draw() < weather.double:
            self.counts["doubled"] += 1
            self._deliver_late(to, kind, item)

    def _deliver_in_order(self, sender: Process, to: Process, kind: str, item: Any) -> None:
        link = sender.ident, to.ident
        when = self.timeline.now + self.weather.latency * (0.5 + self._rng.random())
        self._last[link] = when = max(when, self._last.get(link, 0.0))
        self.timeline.at(when, to.deliver, kind, item)

    def _deliver_late(self, to: Process, kind: str, item: Any) -> None:
        self.timeline.after(self.weather.latency * 20 * self._rng.random(), to.deliver, kind, item)

    def _token(self, of: Process, to: Process, what: str) -> None:
        if not self.parted(of, to):
            self._deliver_in_order(of, to, "event", Event(what, (of.role, of.ident)))
