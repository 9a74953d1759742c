"""The recorder on the bus: reads the log chunks, asks for those it missed, never touches the tick keys."""

import time
from collections.abc import Callable
from typing import Any

from phototaxis.bus import Bus
from phototaxis.codec import Decoder, Refused
from phototaxis.errors import Unavailable
from phototaxis.messages import LogRequest, Recorded, World
from phototaxis.topics import ROLES, TOPICS

from phototaxis_recorder.sinks import Recording

FLUSH_EVERY = 0.15
CATCH_UP_EVERY = 1.0
"""Seconds after which a silent topic, or one that lags, is asked for what was missed."""
LOGS = ("log/sim", "log/sensors", "log/agent")


class Server:
    """Records whatever run is on the bus.

    Parameters
    ----------
    start : called with the world of a run, begins its recording.
    """

    def __init__(self, bus: Bus, start: Callable[[World], Recording]):
        self._bus, self._start = bus, start
        self._run = ""
        self._recording: Recording | None = None
        self._faults: list[str] = []
        """Of the recordings that are closed."""
        self._expected: dict[tuple[str, str], int] = {}
        """The next chunk of each topic and writer."""
        self._writer: dict[str, str] = {}
        """Who wrote the newest chunk of a topic."""
        self._alive: set[str] = set()
        self._heard: dict[str, float] = {}
        """When the newest chunk of a topic came."""
        self._decoders = {name: Decoder(TOPICS[name].message, TOPICS[name].limit) for name in LOGS}

    def serve(self) -> None:
        """Record until a "stop" event; then take what is still to be had and close the recording.

        Raises
        ------
        Unavailable
            when not all of a recording could be written.
        """
        try:
            self._record()
        finally:
            self._close()
        if self._faults:
            raise Unavailable(self._faults[0])

    def _record(self) -> None:
        flush_at = catch_up_at = 0.0
        while True:
            event = self._bus.receive(timeout=FLUSH_EVERY)
            if event is not None:
                if event.topic == "stop":
                    break
                if event.topic in LOGS:
                    self._take(event.topic, event.message)
                elif event.topic in ("alive", "gone"):
                    self._notice(event.topic, *event.message)
            now = time.monotonic()
            recording = self._recording
            if recording is not None and now >= flush_at:
                recording.translator.flush()
                recording.keep()
                flush_at = now + FLUSH_EVERY
            if recording is not None and now >= catch_up_at:
                self._bus.put(
                    "recording", Recorded(run=self._run, tick=recording.kept, warning=recording.fault or recording.low)
                )
                behind = recording.translator.behind()
                for topic in LOGS:
                    if topic.removeprefix("log/") in behind or now - self._heard.get(topic, 0.0) > CATCH_UP_EVERY:
                        self._catch_up(topic)
                catch_up_at = time.monotonic() + CATCH_UP_EVERY  # what has come meanwhile has its turn first
        if self._recording is not None:
            for topic in LOGS:
                self._catch_up(topic)

    def _close(self) -> None:
        """Write what waits and close the recording, if there is one."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        recording.translator.flush(last=True)
        recording.keep()
        recording.close()
        if recording.fault:
            self._faults.append(recording.fault)

    def _notice(self, what: str, role: str, ident: str) -> None:
        """Somebody came or went: a simulation may have brought a run; the viewer's log tells of it."""
        (self._alive.add if what == "alive" else self._alive.discard)(ident)
        if what == "alive" and role == "sim":
            self._meet()
        if self._recording is not None and role in ROLES and role != "observer":
            self._recording.translator.event(f"{ident} {'is here' if what == 'alive' else 'is gone'}")

    def _meet(self) -> None:
        """Begin a recording if there is a run that is not yet recorded."""
        world = self._bus.ask_one("world")
        if world is None or world.run == self._run:
            return
        self._close()
        self._run, self._expected, self._writer = world.run, {}, {}
        self._recording = self._start(world)

    def _take(self, topic: str, chunk: Any) -> None:
        """One chunk; what was missed before it is asked for first."""
        if chunk.run != self._run:
            self._meet()
            if chunk.run != self._run:
                return
        if self._writer.get(topic) not in (None, chunk.writer):
            self._catch_up(topic)  # what the former one still has comes before
        self._writer[topic], self._heard[topic] = chunk.writer, time.monotonic()
        if chunk.seq > self._expected.get((topic, chunk.writer), 0):
            self._catch_up(topic)
        self._write(topic, chunk)

    def _catch_up(self, topic: str) -> None:
        """Ask the newest writer of a topic (anybody, if none is known) for the chunks that are missing."""
        writer = self._writer.get(topic, "")
        if writer and writer not in self._alive:
            return
        for payload in self._bus.ask(topic, LogRequest(seq=self._expected.get((topic, writer), 0), writer=writer)):
            try:
                self._write(topic, self._decoders[topic](payload))
            except Refused as why:
                self._bus.refuse(topic, str(why))

    def _write(self, topic: str, chunk: Any) -> None:
        if chunk.run != self._run or self._recording is None:
            return
        if chunk.seq < self._expected.get((topic, chunk.writer), 0):
            return
        self._expected[topic, chunk.writer] = chunk.seq + 1
        translator = self._recording.translator
        {"log/sim": translator.sim, "log/sensors": translator.sensors, "log/agent": translator.agent}[topic](chunk)
