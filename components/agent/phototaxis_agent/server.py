"""The agent on the bus: takes the seat, answers readings with commands, keeps itself on disk."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
from phototaxis.bus import Bus
from phototaxis.checkpoint import load, save
from phototaxis.chunks import Chunks
from phototaxis.journal import Journal
from phototaxis.messages import AgentLog, Command, Control, Readings, World
from phototaxis.protocol import Once

from phototaxis_agent.agent import Agent

TABLE_EVERY = 0.5
SAVE_EVERY = 10.0
CLAIM_EVERY = 0.2


class Server:
    """Runs an agent against whatever run is on the bus.

    Parameters
    ----------
    make : makes the agent once the world is known.
    path : checkpoint to write; beside it, `.journal` holds the readings since. None: nothing is kept.
    resume : checkpoint to begin with, if it exists (`required`: it must). When it is of the run on the
        bus, the readings in the journal are gone through again, so that the agent is where it was killed.
    """

    def __init__(
        self, bus: Bus, make: Callable[[World], Agent], path: Path | None, resume: Path | None, required: bool
    ):
        self._bus, self._make, self._path, self._resume, self._required = bus, make, path, resume, required
        self._journal = None if path is None else Journal(path.with_suffix(".journal"))
        self._world: World | None = None
        self._agent: Agent | None = None
        self._once: Once[Command] | None = None
        self._save_at = self._table_at = self._claim_at = 0.0
        self._saved: tuple[str, int] = ("", -1)
        self._log = Chunks(bus, "log/agent", self._chunk)

    def serve(self) -> None:
        """Drive until a "stop" event, then leave the seat and save."""
        while True:
            event = self._bus.receive(timeout=0.05)
            if event is None:
                self._log.poll(time.monotonic())
            elif event.topic == "readings":
                self._readings(event.message)
            elif event.topic == "log/agent":
                self._log.answer(event)
            elif event.topic == "stop":
                break
        self._log.flush()
        if self._agent is not None:
            self._bus.control(Control("release", self._bus.ident), timeout=0.5)
            self._save()

    def _readings(self, readings: Readings) -> None:
        now = time.monotonic()
        if readings.driver != self._bus.ident:
            if not readings.driver and now >= self._claim_at and self._meet(readings.run):
                self._claim_at = now + CLAIM_EVERY
                self._bus.control(Control("claim", self._bus.ident))
            return
        if not self._meet(readings.run):
            return
        assert self._once is not None
        assert self._agent is not None
        assert self._world is not None
        fresh = (readings.run, readings.tick) != self._agent.tick
        if fresh and self._journal is not None:
            self._journal.append(msgspec.msgpack.encode(readings))
        command = self._once(readings)
        if command is None:
            return
        if 0 < self._world.epochs <= readings.epoch:
            self._save()  # before the last answer: who sees the run finished finds the checkpoint
        self._bus.put("command", command)
        if fresh:
            self._record(now)
            if now >= self._save_at:
                self._save()

    def _meet(self, run: str) -> bool:
        """Be ready for a run; False when its world is not to be had now."""
        if self._world is not None and self._world.run == run:
            return True
        world = self._bus.ask_one("world", World)
        if world is None or world.run != run:
            return False
        self._log.flush()
        self._world = world
        if self._agent is None:
            self._agent = self._make(world)
            self._agent.author = self._bus.ident
            if self._resume is not None and (self._required or self._resume.exists()):
                self._agent.restore(*load(self._resume), source=str(self._resume))
        self._once = Once(self._agent)
        self._replay(run)
        self._save_at = time.monotonic() + SAVE_EVERY
        return True

    def _replay(self, run: str) -> None:
        """Go through the journal's readings again where they are of this run; else begin a new journal."""
        if self._journal is None:
            return
        assert self._agent is not None
        assert self._once is not None
        frames = self._journal.read() if self._resume is not None else []
        if not frames or frames[0] != run.encode():
            self._journal.begin(run.encode())
            return
        self._journal.begin(run.encode())
        seen, tick = self._agent.tick
        for frame in frames[1:]:
            readings = msgspec.msgpack.decode(frame, type=Readings)
            if seen != run or readings.tick > tick:
                self._journal.append(frame)
                self._once(readings)
                self._record(time.monotonic())

    def _save(self) -> None:
        agent = self._agent
        if agent is None or self._path is None or agent.tick == self._saved:
            return
        save(self._path, *agent.checkpoint())
        self._saved = agent.tick
        if self._journal is not None:
            self._journal.begin(agent.tick[0].encode())
        self._save_at = time.monotonic() + SAVE_EVERY

    def _record(self, now: float) -> None:
        assert self._agent is not None
        self._log.add((self._agent.tick[1], *self._agent.last), now)

    def _chunk(self, seq: int, columns: list[Any]) -> AgentLog:
        agent = self._agent
        assert agent is not None
        table: tuple[list[float], list[int]] = ([], [])
        now = time.monotonic()
        if now >= self._table_at:
            self._table_at = now + TABLE_EVERY
            table = agent.table(), agent.visits.tolist()
        return AgentLog(agent.tick[0], seq, self._bus.ident, agent.name, agent.task.percept, *columns, *table)
