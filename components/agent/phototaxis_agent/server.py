"""The agent on the bus: takes the seat, answers readings with commands, hands over, keeps itself on disk."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
from phototaxis.bus import Bus, Event
from phototaxis.checkpoint import decode, encode, load, save
from phototaxis.chunks import Chunks
from phototaxis.codec import Refused
from phototaxis.disk import unwritten
from phototaxis.errors import Unavailable, UserError, warn
from phototaxis.journal import GIVEN_UP, Journal
from phototaxis.messages import (
    AgentLog,
    CheckpointReply,
    CheckpointRequest,
    Command,
    CommandOfMany,
    Control,
    Readings,
    ReadingsOfMany,
    World,
)
from phototaxis.protocol import Once
from phototaxis.seated import SeatedAgent

from phototaxis_agent.many import Flock
from phototaxis_agent.stuck import watched

TABLE_EVERY = 0.5
SAVE_EVERY = 10.0
CLAIM_EVERY = 0.2
INHERIT_WITHIN = 4.0
"""Seconds that a predecessor gets to hand over what it knows."""

Mode = Literal["claim", "take over", "stand by"]
"""How the seat is sought: when it is free; from whoever holds it; when its holder vanishes."""


@dataclass
class Session:
    """The agent in one run."""

    world: World
    agent: SeatedAgent
    answer: Once[Any]


def _answering(world: World, agent: SeatedAgent) -> Once[Any]:
    """What answers each tick of a world once; of many robots' memories nothing is inherited but what was learned."""
    return Once(Flock(agent, world.robots)) if world.robots > 1 else Once(agent, agent.tick, agent.command)


class Server:
    """Runs an agent against whatever run is on the bus.

    Parameters
    ----------
    make : makes the agent once the world is known.
    path : checkpoint to write; beside it, `.journal` holds the readings since. None: nothing is kept.
    resume : checkpoint to begin with, if it exists (`required`: it must). When it is of the run on the
        bus, the readings in the journal are gone through again, so that the agent is where it was killed.
    mode, at : how the seat is sought, and from which tick on it is taken over.

    Who waits for the seat of an agent of its own kind (the same learner and percept) inherits from it: a
    standby at once, and then keeps in step with it; a taker-over when it sits down. Behind an agent of
    another kind it learns from what that one does.

    A checkpoint or journal that cannot be written is told, tried again with the next checkpoint, and does not
    end the learning.
    """

    def __init__(
        self,
        bus: Bus,
        make: Callable[[World], SeatedAgent],
        path: Path | None,
        resume: Path | None,
        required: bool,
        mode: Mode = "claim",
        at: int = 0,
    ):
        self._bus, self._make, self._path, self._resume, self._required = bus, make, path, resume, required
        self._mode: Mode = mode
        self._at = at
        self._journal = None if path is None else Journal(path.with_suffix(".journal"))
        self._session: Session | None = None
        self._driving = self._seated = self._replaced = self._enlisted = False
        self._leader = self._predecessor = ""
        """The driver that is followed; the last one that was seen."""
        self._related = self._in_step = False
        """Whether it is of the same kind; whether this agent is what it is."""
        self._save_at = self._table_at = self._claim_at = 0.0
        self._saved: tuple[str, int] = ("", -1)
        self._warned = False
        self._log = Chunks(bus, "log/agent", self._chunk)

    def serve(self) -> None:
        """Drive, or wait for the seat, until a "stop" event or until a successor drives; leave the seat and save.

        Raises
        ------
        Unavailable
            when the last checkpoint cannot be written.
        """
        with watched():
            while not self._replaced and self._handle(self._bus.receive(timeout=0.05)):
                pass
            self._log.flush()
            if self._session is not None:
                self._bus.control(Control("release", self._bus.ident), timeout=0.5)
                if fault := self._save(self._session.agent, last=True):
                    raise fault

    def _handle(self, event: Event | None) -> bool:
        """Do what one event asks for; False when it is to stop."""
        if event is None:
            self._log.poll(time.monotonic())
        elif event.topic in ("readings", "crowd/readings"):
            self._readings(event.message)
        elif event.topic == "log/agent":
            self._log.answer(event)
        elif event.topic == "checkpoint":
            self._bequeath(event)
        elif event.topic == "alive" and event.message[0] == "sim":
            self._enlisted = False  # a simulation that is back knows nothing of who waits for its seat
        return event is None or event.topic != "stop"

    def _readings(self, readings: Readings | ReadingsOfMany) -> None:
        session = self._meet(readings.run)
        if session is None:
            return
        if readings.driver == self._bus.ident:
            if not self._driving:
                self._sit(session, readings)
            self._drive(session, readings)
            return
        if self._driving:
            self._driving, self._enlisted = False, False
            self._log.flush()
            self._say(f"unseated at tick {readings.tick}: {readings.driver or 'nobody'} drives")
        elif self._seated and readings.driver and readings.author == readings.driver:
            self._replaced = self._mode != "stand by"
        self._seek(readings)
        if self._mode != "claim" and readings.driver:
            self._predecessor = readings.driver
            if isinstance(readings, Readings):
                self._follow(session, readings)

    def _seek(self, readings: Readings | ReadingsOfMany) -> None:
        """Ask for the seat, as the mode says."""
        now = time.monotonic()
        if now < self._claim_at:
            return
        if self._mode == "claim":
            if not readings.driver:
                self._claim_at = now + CLAIM_EVERY
                self._bus.control(Control("claim", self._bus.ident))
            elif not self._enlisted:
                self._enlisted = True
                self._say(f"waits until {readings.driver} leaves the seat; --take-over takes it, --standby inherits it")
        elif not self._enlisted:
            self._claim_at = now + CLAIM_EVERY
            reply = self._bus.control(Control(self._mode, self._bus.ident, at=self._at))
            self._enlisted = reply is not None and reply.ok
            if self._enlisted:
                waits = "stands by" if self._mode == "stand by" else f"takes over from tick {self._at} on"
                self._say(f"{waits}; {readings.driver or 'nobody'} drives at tick {readings.tick}")

    def _follow(self, session: Session, readings: Readings) -> None:
        """Learn from what another driver does; a standby of its kind keeps in step with it."""
        if readings.driver != self._leader and readings.author == readings.driver:  # it has nothing to ask us any more
            self._leader = readings.driver
            self._related = self._inherit(session, probe=True)
        if self._mode == "stand by":
            if self._related and not (self._in_step and readings.tick <= session.agent.tick[1] + 1):
                self._in_step = self._inherit(session)
            self._answer(session, readings)
        elif self._leader and not self._related:
            self._answer(session, readings)

    def _sit(self, session: Session, readings: Readings | ReadingsOfMany) -> None:
        """Begin to drive, with what the predecessor knows if it is of the same kind."""
        if self._predecessor and not self._in_step and self._mode != "claim":
            self._leader = self._predecessor
            if self._inherit(session):
                self._say(f"inherited what {self._leader} knew at tick {session.agent.tick[1]}")
        self._driving = self._seated = self._in_step = True
        if self._mode == "take over":  # but once
            self._mode = "claim"
        self._say(f"drives from tick {readings.tick} on")

    def _inherit(self, session: Session, probe: bool = False) -> bool:
        """Become what the leader is; whether it could. `probe`: only find out whether it would fit."""
        agent = session.agent
        request = CheckpointRequest(self._leader, agent.name, agent.task.percept, probe)
        reply: CheckpointReply | None = self._bus.ask_agent(self._leader, "checkpoint", request, INHERIT_WITHIN)
        if reply is None or reply.reason or probe:
            if not probe:
                self._say(f"inherited nothing: {self._leader} {'does not answer' if reply is None else reply.reason}")
            return reply is not None and not reply.reason
        try:
            meta, arrays = decode(reply.data, self._leader)
            if meta.run != session.world.run:
                return False
            agent.restore(meta, arrays, self._leader)
        except UserError as error:
            self._say(str(error))
            return False
        session.answer = _answering(session.world, agent)
        self._save(agent)
        return True

    def _bequeath(self, event: Event) -> None:
        """Tell a successor what it needs to continue."""
        request: CheckpointRequest | None = event.message
        if request is None or request.agent != self._bus.ident or event.reply is None:
            return
        session, reply = self._session, CheckpointReply()
        if session is None:
            reply.reason = "knows nothing yet"
        elif (request.learner, request.percept) != (session.agent.name, session.agent.task.percept):
            reply.reason = f"is {session.agent.name} with the percept {session.agent.task.percept}"
        elif not request.probe:
            reply.data = encode(*session.agent.checkpoint())
        event.reply(reply)

    def _drive(self, session: Session, readings: Readings | ReadingsOfMany) -> None:
        """Answer one tick: first to the journal, then to the learner, then to the bus."""
        agent = session.agent
        fresh = (readings.run, readings.tick) != agent.tick
        command = self._answer(session, readings)
        if command is None:
            return
        if 0 < session.world.epochs <= readings.epoch:
            self._save(agent, last=True)  # before the last answer: who sees the run finished finds the checkpoint
        self._bus.put("command" if isinstance(readings, Readings) else "crowd/command", command)
        if fresh:
            self._record(agent)

    def _answer(self, session: Session, readings: Readings | ReadingsOfMany) -> Command | CommandOfMany | None:
        """The command for one tick, whether it will count or not. Of many robots no journal is kept."""
        agent = session.agent
        journal = self._journal if isinstance(readings, Readings) else None
        if journal is not None and (readings.run, readings.tick) != agent.tick:
            self._keep(journal, agent, msgspec.msgpack.encode(readings))
        try:
            command = session.answer(readings)
        except Refused as why:
            return self._bus.refuse("crowd/readings", str(why))
        if time.monotonic() >= self._save_at:
            self._save(agent)
        return command

    def _meet(self, run: str) -> Session | None:
        """The agent, ready for a run; None when its world is not to be had now."""
        if self._session is not None and self._session.world.run == run:
            return self._session
        world = self._bus.ask_one("world")
        if world is None or world.run != run:
            return None
        if world.robots > 1 and self._mode == "stand by":
            raise UserError(f"a standby keeps in step with the driver of one robot; this world has {world.robots}")
        self._log.flush()
        if self._session is None:
            agent = self._make(world)
            agent.author = self._bus.ident
            if self._resume is not None and (self._required or self._resume.exists()):
                meta, arrays = load(self._resume)
                agent.restore(meta, arrays, str(self._resume))
                if other := meta.elsewhere(world.arena):
                    warn(f"{self._resume}: {other}")
        else:
            agent = self._session.agent
            agent.enter(world.arena)
        self._session = Session(world, agent, _answering(world, agent))
        self._driving = self._seated = self._enlisted = self._related = self._in_step = False
        self._leader = self._predecessor = ""
        self._replay(self._session)
        self._save_at = time.monotonic() + SAVE_EVERY
        return self._session

    def _replay(self, session: Session) -> None:
        """Go through the journal's readings again where they are of this run; else begin a new journal."""
        journal = self._journal
        if journal is None:
            return
        run = session.world.run
        frames = journal.read() if self._resume is not None else []
        try:
            if not frames or frames[0] != run.encode():
                journal.begin(run.encode())
                return
            journal.resume(frames)
        except OSError as error:
            raise unwritten(journal.path, error) from None
        seen, tick = session.agent.tick
        for frame in frames[1:]:
            if frame == GIVEN_UP:
                raise Unavailable(
                    f"{journal.path}: could not be written to its end; what was learned after tick {tick} is lost, "
                    f"begin a new run with --resume {self._resume}"
                )
            readings = msgspec.msgpack.decode(frame, type=Readings)
            if seen != run or readings.tick > tick:
                session.answer(readings)
                self._record(session.agent)

    def _keep(self, journal: Journal, agent: SeatedAgent, entry: bytes) -> None:
        """Add to the journal; a full one is given up, which frees its space for the checkpoint that replaces it."""
        for tried_before in (False, True):
            try:
                if journal.kept:
                    journal.append(entry)
                return
            except OSError as error:
                self._tell(unwritten(journal.path, error))
                journal.give_up()
            if not tried_before:
                self._save(agent)

    def _save(self, agent: SeatedAgent, last: bool = False) -> UserError | None:
        """Write the checkpoint and begin the journal anew; why that is not possible now."""
        self._save_at = time.monotonic() + SAVE_EVERY
        if self._path is None or (agent.tick == self._saved and (self._journal is None or self._journal.kept)):
            return None
        meta, arrays = agent.checkpoint()
        if last:
            agent.prove(arrays)
        try:
            save(self._path, meta, arrays)
        except Unavailable as fault:
            self._tell(fault)
            return fault
        self._saved = agent.tick
        if self._journal is not None:
            try:
                self._journal.begin(agent.tick[0].encode())
            except OSError as error:
                self._journal.give_up()
                self._tell(unwritten(self._journal.path, error))
        return None

    def _tell(self, fault: UserError) -> None:
        """Warn, but once, that something cannot be written."""
        if not self._warned:
            self._warned = True
            warn(f"{self._bus.ident}: {fault}; if it dies now, what it learned since its last checkpoint is lost")

    def _record(self, agent: SeatedAgent) -> None:
        self._log.add((agent, agent.tick[1], *agent.last), time.monotonic())

    def _chunk(self, seq: int, columns: list[Any]) -> AgentLog:
        agents, tick, state, action, reward, error, temperature = columns
        agent: SeatedAgent = agents[0]
        log = AgentLog(
            agent.tick[0], seq, self._bus.ident, agent.name, agent.task.percept,
            tick, state, action, reward, error, temperature,
        )  # fmt: skip
        now = time.monotonic()
        if now >= self._table_at:
            self._table_at = now + TABLE_EVERY
            log.values, log.visits, log.current = agent.table(), list(agent.visits), agent.current()
        return log

    def _say(self, text: str) -> None:
        print(f"{self._bus.ident}: {text}", file=sys.stderr, flush=True)
