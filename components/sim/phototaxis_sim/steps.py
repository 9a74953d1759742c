"""The step itself: a command comes, is held, is applied once, and the next tick is asked."""

import msgspec
from phototaxis.runtime.machine import Append, Begin, Effect, Flush, Publish, Refusal, Refuse, Say
from phototaxis.runtime.protocol import RetransmitTimer
from phototaxis.runtime.transitions import Transitions
from phototaxis.wire.codec import Refused
from phototaxis.wire.messages import BatchCommand, Command, EndedEpisode, State
from phototaxis.wire.topics import step_topics

from phototaxis_sim.continued import Continued, Entry
from phototaxis_sim.lateness import Lateness
from phototaxis_sim.log import row
from phototaxis_sim.pace import Pace
from phototaxis_sim.phases import TABLE, Given, Phase
from phototaxis_sim.report import Report
from phototaxis_sim.seat import Seat
from phototaxis_sim.simulated import Simulated


class Steps:
    """Takes a simulation from tick to tick by the commands of whoever holds the seat.

    What follows is gathered in `out`, in the order that the protocol needs: an entry is in the journal before anybody
    hears of the tick that it led to, and a row is recorded while the others compute already.

    Attributes
    ----------
    now : the present time in seconds; the caller sets it.
    out : the effects so far; the caller takes them.
    held : the driver's command for the present tick; None until it comes.
    heard_at : the time of the driver's last command, or of the moment when it got the seat.
    """

    def __init__(self, simulation: Simulated, pace: Pace):
        self.simulation, self.pace = simulation, pace
        self.seat, self.report, self.lateness = Seat(), Report(), Lateness()
        self.question, self.phase = RetransmitTimer(), Transitions(TABLE, Phase.WAITING)
        self.now, self.heard_at, self.out = 0.0, 0.0, list[Effect]()
        self.held: Command | BatchCommand | None = None
        self.steps_due = 0
        """Single steps that are still to be made of a paused run."""
        self._state_topic = step_topics(simulation.world.robots).state
        self._keeps = self.snapshot() is not None
        self._driver = ""
        self._ended: tuple[EndedEpisode, ...] = ()
        self._recorded = ("", -1)

    @property
    def tick(self) -> int:
        """The present tick."""
        return self.simulation.state.tick

    @property
    def state(self) -> Phase:
        """What the simulation is doing."""
        return self.phase.state

    @property
    def unanswered(self) -> bool:
        """Whether the driver has yet to answer the present tick."""
        return self.held is None and bool(self.seat.driver) and self.state is not Phase.FINISHED

    def snapshot(self) -> bytes | None:
        """What the journal begins with, at an episode's first tick; None where a run cannot be continued."""
        found = self.simulation.snapshot(list(self.report.recent), self.seat.driver)
        return None if found is None else msgspec.msgpack.encode(found)

    def command(self, command: Command | BatchCommand) -> None:
        """Take a command, if it is the driver's, for the present tick."""
        state = self.simulation.state
        try:
            if command.run != state.run:
                raise Refused(f"another run: {command.run}")
            if command.tick != state.tick:
                raise Refused(f"late or repeated: for tick {command.tick}, at {state.tick}")
            if command.author != self.seat.driver or not command.author:
                raise Refused(f"not the driver: {command.author}")
            self.simulation.check(command)
        except Refused as why:
            self.report.refuse(Refusal("command", str(why)))
            self.out.append(Refuse("command", str(why)))
            return
        self.held, self.heard_at = command, self.now
        if self.report.started is None:
            self.report.started = self.now, state.tick
            self.out.append(Say(f"{command.author} drives in the run {state.run}, from tick {state.tick} on"))
        self.pace.commanded(self.now)
        if self.state is not Phase.ASKING:
            self.record(self.simulation.watched)
        if not self.pace.realtime or self.steps_due:
            self.use()

    def use(self) -> None:
        """Apply the command of the present tick, if it is there and the run goes on."""
        command = self.held
        if command is None or self.state is Phase.FINISHED:
            return
        if self.simulation.finished:
            self.record(self.simulation.watched)
            self.report.measure(self.now, self.tick)
            self.phase.take(Given.LAST)
            self.out += Flush(), Say(f"the run {self.simulation.world.run} is finished, at tick {self.tick}")
            self.report.due_at = self.now
        elif self.state is Phase.ASKING or (self.state is Phase.PAUSED and self.steps_due):
            self.steps_due, self.heard_at = max(self.steps_due - 1, 0), self.now
            self.apply(Entry(command.left, command.right, command.author, command.end))

    def by_the_clock(self) -> None:
        """In real time: the newest command holds until it is stale, then the motors stop."""
        if self.held is not None:
            self.lateness.in_time()
            self.use()
        elif not self.simulation.finished:
            state, sensed = self.simulation.state, self.report.sensed
            self.lateness.late(sensed is None or sensed >= state.tick)
            stale = self.pace.stale(self.now)
            self.apply(Entry(0.0, 0.0, "", "") if stale else Entry(state.left, state.right, state.author, ""))
        self.pace.begun(self.now)

    def apply(self, entry: Entry) -> None:
        """Go on by one tick."""
        before = self.simulation.watched
        self._advance(entry)
        self.seat.boundary(self.tick)
        if entry.end:
            self._begin_journal()
        elif self._keeps:
            self.out.append(Append(msgspec.msgpack.encode(entry)))
        self.ask()
        self.record(before)
        if self.simulation.ended is not None:
            self._ended += (self.simulation.ended,)
            self.out.append(Publish("episode", self.simulation.ended))

    def ask(self) -> None:
        """Ask the present driver for the command of the present tick."""
        driver = self.seat.driver
        waited = self.state is Phase.WAITING
        self.phase.take(Given.SEATED if driver else Given.VACATED)
        if waited and self.state is Phase.ASKING:
            self.pace.set(self.pace.speed, self.now)
        if self._driver != driver:
            self._driver, self.heard_at = driver, self.now
            self.held = None  # its author drives no more
        self.question.asked(self.now)
        self.publish()

    def publish(self) -> None:
        """Publish the present tick, also once more."""
        self.simulation.state.driver = self.seat.driver
        self.out.append(Publish(self._state_topic, self.simulation.state))

    def record(self, state: State) -> None:
        """Record a tick, once."""
        if self._recorded != (state.run, state.tick):
            self._recorded = state.run, state.tick
            self.out.append(row(state, self._ended, self.lateness.ticks))
            self._ended = ()

    def begin(self, simulation: Simulated) -> None:
        """Begin another run; the driver keeps the seat."""
        self.out.append(Flush())
        self.simulation, self.held, self.lateness, self._ended = simulation, None, Lateness(), ()
        self.report.begin()
        self.heard_at = self.now
        self.phase.take(Given.BEGIN)
        self._begin_journal()
        self.ask()

    def go_on(self, found: Continued) -> None:
        """Continue a run that was killed: make its commands since the episode's start again."""
        self.simulation = found.simulation
        self.report.recent.extend(found.snapshot.recent)
        self.seat.heir = found.snapshot.driver
        for entry in found.entries:
            self.record(self.simulation.watched)
            self._advance(entry)
            self.seat.heir = entry.author or self.seat.heir

    def _advance(self, entry: Entry) -> None:
        self.held = None
        self.simulation.advance(entry.left, entry.right, entry.author, entry.end)
        self.report.recent.extend(self.simulation.outcomes)

    def _begin_journal(self) -> None:
        header = self.snapshot()
        if header is not None:
            self.report.unkept = ""
            self.out.append(Begin(header))
