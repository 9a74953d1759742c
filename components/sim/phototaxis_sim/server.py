"""The simulation on the bus: asks each tick, waits for its answer, keeps the seat and the status."""

import math
import re
import secrets
import sys
import time
from collections import deque
from typing import Any

import msgspec
from phototaxis.bus import Bus, Event
from phototaxis.chunks import Chunks
from phototaxis.codec import Refused
from phototaxis.disk import unwritten
from phototaxis.errors import Unavailable, UserError, warn
from phototaxis.journal import GIVEN_UP, Journal
from phototaxis.messages import Command, CommandOfMany, Control, ControlReply, Phase, Recorded, SimLog, State, Status
from phototaxis.protocol import Question

from phototaxis_sim.lateness import Lateness
from phototaxis_sim.many import SimulationOfMany
from phototaxis_sim.pace import Pace
from phototaxis_sim.seat import Seat
from phototaxis_sim.simulation import Simulation, Snapshot

STATUS_EVERY = 0.2
WAITS_AFTER = 0.5
"""Seconds without an answer after which the status says "waiting" and for whom."""
ANSWERED_WITHIN = 2.0
"""Seconds that the driver gets to answer the last tick of a simulation that was asked to stop."""
HEIR_WITHIN = 3.0
"""Seconds that a continued simulation keeps the seat for its former driver."""


class Entry(msgspec.Struct, array_like=True):
    """What is applied at one tick, and what the journal keeps of it (of many robots: columns, and no journal)."""

    left: Any
    right: Any
    author: str
    end: Any


class Server:
    """Drives a `Simulation` by the answers that come from the bus.

    With a journal that holds the same run, it continues where that run was killed: the episode's start
    is restored and its commands are made again. A journal that cannot be written is given up until the next
    episode; the run goes on, and the status warns that it could not be continued. A driver that is there but
    has not answered for `patience` seconds loses the seat if somebody else waits for it.

    Raises
    ------
    UserError
        when the journal is not one of a simulation.
    Unavailable
        when it cannot be begun, or was given up before the simulation died.
    """

    def __init__(
        self,
        bus: Bus,
        simulation: Simulation | SimulationOfMany,
        pace: Pace,
        journal: Journal | None = None,
        patience: float = 5.0,
    ):
        self._bus, self._pace, self._journal = bus, pace, journal
        self._sim: Any = simulation
        self._root = simulation.world.run[:50]
        self._prefix = "crowd/" if simulation.world.robots > 1 else ""
        self._patience, self._logged = patience, ""
        self._heard_of, self._heard_at = "", 0.0
        self._question = Question()
        self._alive: set[str] = set()
        self._held: Command | CommandOfMany | None = None
        self._paused = self._stopping = self._finished = False
        self._stop_by = math.inf
        """When a simulation that was asked to stop waits no longer for the answer to its last tick."""
        self._steps_due = 0
        self._recent: deque[bool] = deque(maxlen=50)
        self._status_at = self._rate_at = 0.0
        self._rate_tick, self._rate = 0, 0.0
        self._started: tuple[float, int] | None = None
        self._mean_rate = 0.0
        self._ended: list[Any] = []
        self._unkept = ""
        """That the journal is given up, and why."""
        self._recorded: Recorded | None = None
        self._logged_until = ("", -1)
        """Run and tick of the newest row of the log."""
        self._log = Chunks(bus, "log/sim", self._chunk)
        self._seat = Seat()
        self._lateness, self._told = Lateness(), ""
        self._sensed: int | None = None
        """The newest tick whose readings came, as far as they are listened to; None until there are any."""
        if journal is not None:
            self._seat.heir = self._continue(journal)
        self._heir_until = time.monotonic() + HEIR_WITHIN

    def serve(self) -> None:
        """Run until a "stop" event or request."""
        self._pace_set()
        self._ask()
        while not self._stopping:
            event = self._bus.receive(timeout=self._timeout())
            if event is not None:
                self._handle(event)
            now = time.monotonic()
            if self._pace.realtime and not self._paused and self._pace.wait(now) == 0:
                self._tick_by_clock(now)
            elif self._question.due(now) and not self._finished:
                self._publish()
            self._mind_the_seat(now)
            self._log.poll(now)
            if now >= self._status_at:
                self._announce(now)
            if now >= self._stop_by or (self._stop_by < math.inf and not self._unanswered):
                self._stopping = True
        self._record(self._sim.watched)
        self._log.flush()
        self._announce(time.monotonic())

    def _timeout(self) -> float:
        now = time.monotonic()
        until = min(self._status_at, self._question.repeat_at) - now
        if self._pace.realtime and not self._paused:
            until = min(until, self._pace.wait(now))
        return min(max(until, 0.0), 0.05)

    def _handle(self, event: Event) -> None:
        if event.topic == f"{self._prefix}command":
            self._command(event.message)
        elif event.topic == f"{self._prefix}readings":
            self._sensed = event.message.tick if event.message.run == self._sim.state.run else self._sensed
        elif event.topic == "control":
            self._control(event)
        elif event.topic == "world" and event.reply:
            event.reply(self._sim.world)
        elif event.topic == "log/sim":
            self._log.answer(event)
        elif event.topic == "recording":
            self._recorded = event.message
        elif event.topic == "alive":
            self._alive.add("/".join(event.message))
        elif event.topic == "gone":
            role, ident = event.message
            self._alive.discard(f"{role}/{ident}")
            if role == "agent" and self._seat.leave(ident, self._sim.state.tick):
                self._ask()
        elif event.topic == "stop":
            self._stopping = True

    def _mind_the_seat(self, now: float) -> None:
        """A free seat whose heir does not come, or a driver that keeps silent: the next one may sit down."""
        tick = self._sim.state.tick
        if self._seat.heir and not self._seat.driver and now > self._heir_until:
            self._seat.heir = ""
            if self._seat.vacate(tick):
                self._ask()
        if self._seat.driver != self._heard_of or self._held is not None or self._paused or self._finished:
            self._heard_of, self._heard_at = self._seat.driver, now
        elif self._seat.driver and self._seat.next(tick) and now - self._heard_at > self._patience:
            line = f"{self._seat.driver} has been silent for {self._patience:g} s and loses the seat at tick {tick}"
            self._say(line)
            self._seat.vacate(tick)
            self._ask()

    def _command(self, command: Command | CommandOfMany) -> None:
        state = self._sim.state
        if command.run != state.run:
            return self._bus.refuse("command", f"another run: {command.run}")
        if command.tick != state.tick:
            return self._bus.refuse("command", f"late or repeated: for tick {command.tick}, at {state.tick}")
        if command.author != self._seat.driver or not command.author:
            return self._bus.refuse("command", f"not the driver: {command.author}")
        try:
            self._sim.check(command)
        except Refused as why:
            return self._bus.refuse("command", str(why))
        self._held = command
        now = self._heard_at = time.monotonic()
        if self._started is None:
            self._started = now, state.tick
            self._say(f"{command.author} drives in the run {state.run}, from tick {state.tick} on")
        self._pace.commanded(now)
        if self._paused:
            self._record(self._sim.watched)
        if not self._pace.realtime:
            self._answered()
        return None

    def _answered(self) -> None:
        """The command of this tick is here: apply it, unless the run is over or paused."""
        command = self._held
        if command is None or self._finished:
            return
        if self._sim.finished:
            self._record(self._sim.watched)
            self._log.flush()
            self._announce(time.monotonic())  # the last mean rate
            self._finished = True
            self._say(f"the run {self._sim.state.run} is finished, at tick {self._sim.state.tick}")
            self._announce(time.monotonic())
        elif not self._paused or self._steps_due:
            self._steps_due = max(self._steps_due - 1, 0)
            self._apply(Entry(command.left, command.right, command.author, command.end))

    def _tick_by_clock(self, now: float) -> None:
        """In real time: the newest command holds until it is stale, then the motors stop."""
        state = self._sim.state
        if self._held is not None:
            self._lateness.in_time()
            self._answered()
        elif self._seat.driver and not self._sim.finished:
            self._lateness.late(self._sensed is None or self._sensed >= state.tick)
            motors = (0.0, 0.0, "") if self._pace.stale(now) else (state.left, state.right, state.author)
            self._apply(Entry(*motors, ""))
        self._pace.begun(now)

    def _apply(self, entry: Entry) -> None:
        if not entry.end:
            self._keep(entry)
        before = self._sim.watched
        self._advance(entry)
        if entry.end:
            self._keep_from_here()
        self._seat.boundary(self._sim.state.tick)
        self._ask()
        self._record(before)  # while the others compute
        if self._sim.ended is not None:
            self._ended.append(self._sim.ended)
            self._bus.put("episode", self._sim.ended)

    def _advance(self, entry: Entry) -> None:
        self._held = None
        self._sim.advance(entry.left, entry.right, entry.author, entry.end)
        self._recent.extend(self._sim.outcomes)

    def _ask(self) -> None:
        self._question.asked(time.monotonic())
        self._publish()

    def _publish(self) -> None:
        self._sim.state.driver = self._seat.driver
        self._bus.put(f"{self._prefix}state", self._sim.state)

    def _control(self, event: Event) -> None:
        request: Control | None = event.message
        reason = "an empty request" if request is None else self._obey(request)
        if event.reply:
            event.reply(ControlReply(not reason, reason, self._status(time.monotonic())))

    def _obey(self, request: Control) -> str:
        """Do what is asked; a reason when it is refused, else ""."""
        verb, now = request.verb, time.monotonic()
        if verb in ("claim", "take over", "stand by", "release"):
            driver = self._seat.driver
            reason = self._reseat(request)
            if self._seat.driver != driver:
                self._ask()
            return reason
        if verb == "pause":
            self._pause()
        elif verb == "resume":
            self._paused, self._steps_due = False, 0
            self._pace.set(self._pace.speed, now)
            self._answered()
        elif verb == "step":
            if not self._paused:
                return "single steps need a paused simulation; pause it first"
            self._steps_due += 1
            self._answered()
        elif verb == "speed":
            self._pace.set(request.speed, now)
            self._pace_set()
        elif verb == "reset":
            if self._finished or self._sim.finished:
                return "the run is finished"
            self._apply(Entry(0.0, 0.0, self._seat.driver, "reset"))
        elif verb == "begin":
            self._begin(request.seed)
        elif verb == "stop":
            self._pause()
            self._stop_by = now + ANSWERED_WITHIN
        return ""

    def _pace_set(self) -> None:
        """In real time the readings are listened to, to know whether sensors or agent are too slow."""
        self._bus.listen(f"{self._prefix}readings", self._pace.realtime)

    def _too_slow(self) -> str:
        """Which part cannot keep up with the speed, in words."""
        sensors = next((who.split("/")[1] for who in sorted(self._alive) if who.startswith("sensors/")), "the sensors")
        return self._lateness.told(self._seat.driver or "the agent", sensors) if self._pace.realtime else ""

    def _say(self, text: str) -> None:
        print(f"sim: {text}", file=sys.stderr, flush=True)

    def _pause(self) -> None:
        """Apply no more commands; the present tick is still answered, and is then the last that is recorded."""
        self._paused, self._steps_due = True, 0
        if self._held is not None:
            self._record(self._sim.watched)

    @property
    def _unanswered(self) -> bool:
        """Whether the driver has yet to answer the present tick."""
        return bool(self._seat.driver) and self._held is None and not self._finished

    def _begin(self, seed: int) -> None:
        """A new run in the same arena; its name says from which it comes, for the journal."""
        self._log.flush()
        self._sim = self._sim.anew(seed, f"{self._root}.{secrets.token_hex(2)}")
        self._held, self._started, self._finished = None, None, False
        self._lateness, self._sensed = Lateness(), None
        self._recent.clear()
        self._ended.clear()
        self._rate_at = self._rate = self._mean_rate = 0.0
        self._keep_from_here()
        self._ask()

    def _reseat(self, request: Control) -> str:
        """Do what an agent asks about the seat; a reason when it is refused, else ""."""
        seat, agent, tick = self._seat, request.agent, self._sim.state.tick
        if request.verb == "claim":
            return seat.claim(agent, tick)
        if request.verb == "stand by":
            return seat.stand_by(agent, tick)
        if request.verb == "release":
            return "" if seat.leave(agent, tick) else f"{agent} does not hold the seat"
        reason = seat.reserve(agent, request.at)
        if not seat.driver:
            seat.boundary(tick)
        return reason

    def _phase(self, now: float) -> tuple[Phase, str, float]:
        """The phase, whom it waits for, and how long."""
        if self._finished:
            return "finished", "", 0.0
        if self._paused:
            return "paused", f"the command of {self._seat.driver}" if self._unanswered else "", 0.0
        waited = now - self._question.asked_at
        missing = [role for role in ("sensors", "agent") if not any(a.startswith(role + "/") for a in self._alive)]
        if missing:
            return "waiting", " and ".join(missing), waited
        if not self._seat.driver:
            return "waiting", "an agent to take the seat", waited
        if waited > max(WAITS_AFTER, 2 * self._pace.wait(now)) and self._held is None:
            return "waiting", f"the command of {self._seat.driver}", waited
        return "running", "", 0.0

    def _status(self, now: float) -> Status:
        sim, (phase, whom, waited) = self._sim, self._phase(now)
        state = sim.state
        return Status(
            run=sim.world.run, phase=phase, waiting_for=whom, waited=waited, speed=self._pace.speed,
            tick=state.tick, epoch=state.epoch, epochs=sim.world.epochs, episode=sim.watched.episode,
            episodes=sim.episodes, reached=sim.reached,
            recent=sum(self._recent) / len(self._recent) if self._recent else 0.0,
            rate=self._rate, mean_rate=self._mean_rate, driver=self._seat.driver, drivers=self._seat.history,
            next=self._seat.waiting, alive=sorted(self._alive),
            late=self._lateness.ticks, late_sensors=self._lateness.unsensed, too_slow=self._too_slow(),
            refused=dict(self._bus.refused), hash=state.hash, warnings=self._warnings(),
        )  # fmt: skip

    def _warnings(self) -> list[str]:
        recorded = self._recorded
        of_recording = recorded.warning if recorded is not None and recorded.run == self._sim.world.run else ""
        return [fault for fault in (self._unkept, of_recording) if fault]

    def _announce(self, now: float) -> None:
        if now - self._rate_at >= 1.0:
            self._rate = (self._sim.state.tick - self._rate_tick) / (now - self._rate_at) if self._rate_at else 0.0
            self._rate_at, self._rate_tick = now, self._sim.state.tick
        self._status_at = now + STATUS_EVERY
        if self._started and not self._finished:
            since, tick = self._started
            self._mean_rate = (self._sim.state.tick - tick) / max(now - since, 1e-9)
        status = self._status(now)
        if status.too_slow and not self._told:
            print(f"sim: at {status.speed:g} × real time {status.too_slow}", file=sys.stderr, flush=True)
        self._told = status.too_slow
        self._bus.put("status", status)

    def _record(self, s: State) -> None:
        if self._logged_until == (s.run, s.tick):
            return
        self._logged_until = s.run, s.tick
        if s.driver != self._logged:  # a chunk has one driver
            self._log.flush()
            self._logged = s.driver
        contact = s.front + 2 * s.rear
        row = (s.tick, s.episode, s.time, s.x, s.y, s.heading, s.left, s.right, contact)
        self._log.add(row, time.monotonic())

    def _chunk(self, seq: int, columns: list[Any]) -> SimLog:
        ended, self._ended = self._ended, []
        tick, episode, seconds, x, y, heading, left, right, contact = columns
        return SimLog(
            self._sim.world.run, seq, self._bus.ident, self._logged,
            tick, episode, seconds, x, y, heading, left, right, contact, ended, self._lateness.ticks,
        )  # fmt: skip

    def _header(self) -> bytes:
        return msgspec.msgpack.encode(self._sim.snapshot(list(self._recent), self._seat.driver))

    def _keep(self, entry: Entry) -> None:
        """Add to the journal, unless it is given up."""
        if self._journal is None or not self._journal.kept:
            return
        try:
            self._journal.append(msgspec.msgpack.encode(entry))
        except OSError as error:
            self._give_up(self._journal, error)

    def _keep_from_here(self) -> None:
        """Begin the journal anew with the episode, also one that was given up."""
        if self._journal is None:
            return
        try:
            self._journal.begin(self._header())
            self._unkept = ""
        except OSError as error:
            self._give_up(self._journal, error)

    def _give_up(self, journal: Journal, error: OSError) -> None:
        journal.give_up()
        self._unkept = f"{unwritten(journal.path, error)}; a simulation that dies in this episode cannot be continued"
        warn(self._unkept)

    def _continue(self, journal: Journal) -> str:
        """Restore what the journal holds of this run, or begin a new journal; who drove last."""
        frames = journal.read()
        try:
            snapshot = msgspec.msgpack.decode(frames[0], type=Snapshot) if frames else None
        except msgspec.MsgspecError:
            raise UserError(f"{journal.path}: not the journal of a simulation; name another file") from None
        if snapshot is not None and re.fullmatch(re.escape(self._root) + r"\.[0-9a-f]{4}", snapshot.run):
            self._sim = self._sim.anew(snapshot.seed, snapshot.run)  # it was begun later, by request
        if snapshot is not None and snapshot.run == self._sim.world.run and snapshot.arena != self._sim.digest:
            raise UserError(f"the run {snapshot.run} began in another arena than '{self._sim.world.arena.name}' is now")
        try:
            if snapshot is None or snapshot.run != self._sim.world.run:
                journal.begin(self._header())
                return ""
            if GIVEN_UP in frames:
                line = "could not be written to its end; the run cannot be continued, begin a new one"
                raise Unavailable(f"{journal.path}: {line}")
            journal.resume(frames)
        except OSError as error:
            raise unwritten(journal.path, error) from None
        self._sim.restore(snapshot)
        self._recent.extend(snapshot.recent)
        driver = snapshot.driver
        for frame in frames[1:]:
            self._record(self._sim.state)
            entry = msgspec.msgpack.decode(frame, type=Entry)
            self._advance(entry)
            driver = entry.author or driver
        return driver
