"""The agent on the bus: takes the seat, answers readings with commands, keeps itself on disk."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

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


class Session(NamedTuple):
    """The agent in one run."""

    world: World
    agent: Agent
    answer: Once[Command]


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
        self._session: Session | None = None
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
        if self._session is not None:
            self._bus.control(Control("release", self._bus.ident), timeout=0.5)
            self._save(self._session.agent)

    def _readings(self, readings: Readings) -> None:
        session = self._meet(readings.run)
        if session is None:
            return
        if readings.driver == self._bus.ident:
            self._drive(session, readings)
        elif not readings.driver and time.monotonic() >= self._claim_at:
            self._claim_at = time.monotonic() + CLAIM_EVERY
            self._bus.control(Control("claim", self._bus.ident))

    def _drive(self, session: Session, readings: Readings) -> None:
        """Answer one tick: first to the journal, then to the learner, then to the bus."""
        agent = session.agent
        fresh = (readings.run, readings.tick) != agent.tick
        if fresh and self._journal is not None:
            self._journal.append(msgspec.msgpack.encode(readings))
        command = session.answer(readings)
        if command is None:
            return
        if 0 < session.world.epochs <= readings.epoch:
            self._save(agent)  # before the last answer: who sees the run finished finds the checkpoint
        self._bus.put("command", command)
        if fresh:
            self._record(agent)
            if time.monotonic() >= self._save_at:
                self._save(agent)

    def _meet(self, run: str) -> Session | None:
        """The agent, ready for a run; None when its world is not to be had now."""
        if self._session is not None and self._session.world.run == run:
            return self._session
        world = self._bus.ask_one("world", World)
        if world is None or world.run != run:
            return None
        self._log.flush()
        if self._session is None:
            agent = self._make(world)
            agent.author = self._bus.ident
            if self._resume is not None and (self._required or self._resume.exists()):
                agent.restore(*load(self._resume), source=str(self._resume))
        else:
            agent = self._session.agent
        self._session = Session(world, agent, Once(agent))
        self._replay(self._session)
        self._save_at = time.monotonic() + SAVE_EVERY
        return self._session

    def _replay(self, session: Session) -> None:
        """Go through the journal's readings again where they are of this run; begin a new journal."""
        if self._journal is None:
            return
        run = session.world.run
        frames = self._journal.read() if self._resume is not None else []
        self._journal.begin(run.encode())
        if not frames or frames[0] != run.encode():
            return
        seen, tick = session.agent.tick
        for frame in frames[1:]:
            readings = msgspec.msgpack.decode(frame, type=Readings)
            if seen != run or readings.tick > tick:
                self._journal.append(frame)
                session.answer(readings)
                self._record(session.agent)

    def _save(self, agent: Agent) -> None:
        if self._path is None or agent.tick == self._saved:
            return
        save(self._path, *agent.checkpoint())
        self._saved = agent.tick
        if self._journal is not None:
            self._journal.begin(agent.tick[0].encode())
        self._save_at = time.monotonic() + SAVE_EVERY

    def _record(self, agent: Agent) -> None:
        self._log.add((agent, agent.tick[1], *agent.last), time.monotonic())

    def _chunk(self, seq: int, columns: list[Any]) -> AgentLog:
        agents, tick, state, action, reward, error, temperature = columns
        agent: Agent = agents[0]
        log = AgentLog(
            agent.tick[0], seq, self._bus.ident, agent.name, agent.task.percept,
            tick, state, action, reward, error, temperature,
        )  # fmt: skip
        now = time.monotonic()
        if now >= self._table_at:
            self._table_at = now + TABLE_EVERY
            log.values, log.visits, log.current = agent.table(), list(agent.visits), agent.current()
        return log
