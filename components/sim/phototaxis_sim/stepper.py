"""The simulation's side of the protocol: steps, seat, requests and status. It decides, and does nothing else."""

import math
from collections.abc import Callable

from phototaxis.runtime.machine import Effect, Event, Flush, Listen, Publish, Reply, Say, Stop, Unwritten, Warn
from phototaxis.wire.codec import Refused
from phototaxis.wire.messages import Control, ControlReply, Status
from phototaxis.wire.topics import step_topics

from phototaxis_sim.continued import Continued, Entry
from phototaxis_sim.pace import Pace
from phototaxis_sim.phases import Given, Phase
from phototaxis_sim.report import STATUS_EVERY_S
from phototaxis_sim.simulated import Simulated
from phototaxis_sim.steps import Steps

ANSWERED_WITHIN_S = 2.0
"""Seconds for the driver's last answer after the simulation is asked to stop."""
HEIR_WITHIN_S = 3.0
"""Seconds for which a continued simulation keeps the seat for its former driver."""


class Stepper:
    """Drives a simulation by the answers that come.

    Parameters
    ----------
    simulation : of one robot, or of many.
    pace : lockstep or real time.
    suffix : makes four hexadecimal digits for the name of a run that is begun by request.
    found : a run restored from the journal of a simulation that was killed; it replaces `simulation`.
    driver_timeout : seconds after which a silent driver loses the seat to whoever waits for it.
    """

    def __init__(
        self,
        simulation: Simulated,
        pace: Pace,
        suffix: Callable[[], str],
        found: Continued | None = None,
        driver_timeout: float = 5.0,
    ):
        self.steps = steps = Steps(simulation, pace)
        self._root, self._suffix, self._driver_timeout = simulation.world.run[:50], suffix, driver_timeout
        self._topics = step_topics(simulation.world.robots)
        self._heir_until = self._stop_by = math.inf
        if found is not None:
            steps.go_on(found)
        self._on: dict[str, Callable[[Event], object]] = {
            "start": self._start,
            self._topics.command: lambda event: steps.command(event.message),
            self._topics.readings: self._readings,
            "control": self._control,
            "world": lambda event: event.reply and steps.out.append(Reply(event.reply, steps.simulation.world)),
            "recording": lambda event: setattr(steps.report, "recorded", event.message),
            "alive": lambda event: steps.report.alive.add("/".join(event.message)),
            "gone": self._gone,
            "refused": lambda event: steps.report.refuse(event.message),
            "write_failure": self._unwritten,
            "stop": lambda _: self._end(),
        }
        self._verbs: dict[str, Callable[[Control], object]] = {
            "status": lambda _: None,
            "pause": lambda _: self._stand(Given.PAUSE),
            "resume": self._resume,
            "step": self._step,
            "speed": self._speed,
            "reset": self._reset,
            "begin": self._begin,
            "stop": self._stop,
            "claim": lambda asked: steps.seat.claim(asked.agent, steps.tick),
            "stand by": lambda asked: steps.seat.stand_by(asked.agent, steps.tick),
            "take over": self._take_over,
            "release": lambda asked: steps.seat.release(asked.agent, steps.tick),
        }

    @property
    def deadline(self) -> float:
        """When the next status, repeat, tick of the clock or end of patience is due."""
        steps = self.steps
        if steps.state is Phase.ENDED:
            return math.inf
        at = min(steps.report.due_at, self._stop_by, self._heir_until)
        if steps.state is not Phase.FINISHED:
            at = min(at, steps.question.repeat_at)
        if self._clocked:
            at = min(at, steps.pace.ends_at)
        return min(at, steps.heard_at + self._driver_timeout) if self._contested else at

    def on(self, event: Event, now: float) -> list[Effect]:
        """What follows from an event: from itself, and from the time that has come."""
        steps = self.steps
        steps.now, steps.out = now, [] if event.topic != "start" else steps.out
        handle = self._on.get(event.topic)
        if handle is not None and steps.state is not Phase.ENDED:
            handle(event)
        if now >= self.deadline:
            self._by_the_clock()
        if self._stop_by < math.inf and (now >= self._stop_by or not steps.unanswered):
            self._end()
        return steps.out

    @property
    def _clocked(self) -> bool:
        """Whether the present tick ends by the clock."""
        return self.steps.pace.realtime and self.steps.state is Phase.ASKING

    @property
    def _contested(self) -> bool:
        """Whether a driver that keeps silent loses the seat."""
        steps = self.steps
        return steps.state is Phase.ASKING and steps.held is None and bool(steps.seat.next(steps.tick))

    def _start(self, _: Event) -> None:
        steps = self.steps
        if steps.seat.heir:
            self._heir_until = steps.now + HEIR_WITHIN_S
        self._pace_set(steps.pace.speed)
        steps.ask()

    def _by_the_clock(self) -> None:
        steps, now = self.steps, self.steps.now
        if self._clocked and steps.pace.wait(now) == 0:
            steps.by_the_clock()
        elif steps.state is not Phase.FINISHED and steps.question.due(now):
            steps.publish()
        if now >= self._heir_until:
            self._heir_until = math.inf
            if steps.seat.heir and not steps.seat.driver:
                steps.seat.heir = ""
                if steps.seat.vacate(steps.tick):
                    steps.ask()
        if self._contested and now >= steps.heard_at + self._driver_timeout:
            who = f"{steps.seat.driver} has been silent for {self._driver_timeout:g} s"
            steps.out.append(Say(f"{who} and loses the seat at tick {steps.tick}"))
            steps.seat.vacate(steps.tick)
            steps.ask()
        if now >= steps.report.due_at:
            self._announce()

    def _readings(self, event: Event) -> None:
        if event.message.run == self.steps.simulation.world.run:
            self.steps.report.sensed = event.message.tick

    def _gone(self, event: Event) -> None:
        role, ident = event.message
        self.steps.report.alive.discard(f"{role}/{ident}")
        if role == "agent" and self.steps.seat.leave(ident, self.steps.tick):
            self.steps.ask()

    def _unwritten(self, event: Event) -> None:
        fault: Unwritten = event.message
        line = f"{fault.why}; a simulation that dies in this episode cannot be continued"
        self.steps.report.unkept = line
        self.steps.out.append(Warn(line))

    def _control(self, event: Event) -> None:
        asked: Control | None = event.message
        steps, driver, reason = self.steps, self.steps.seat.driver, ""
        try:
            if asked is None:
                raise Refused("an empty request")
            self._verbs[asked.verb](asked)
        except Refused as why:
            reason = str(why)
        if steps.seat.driver != driver:
            steps.ask()
        if event.reply is not None:
            steps.out.append(Reply(event.reply, ControlReply(ok=not reason, reason=reason, status=self._status())))

    def _take_over(self, asked: Control) -> None:
        seat, tick = self.steps.seat, self.steps.tick
        seat.reserve(asked.agent, asked.at)
        if not seat.driver:
            seat.boundary(tick)

    def _stand(self, given: Given) -> None:
        """Apply no more commands; the present tick is still answered, and is then the last that is recorded."""
        steps = self.steps
        if steps.state is not Phase.FINISHED:
            steps.phase.take(given)
        steps.steps_due = 0
        if steps.held is not None:
            steps.record(steps.simulation.watched)

    def _resume(self, _: Control) -> None:
        steps = self.steps
        self._refuse_ending()
        paused = steps.state is Phase.PAUSED
        steps.phase.take(Given.RESUME)
        if paused and steps.seat.driver:
            steps.phase.take(Given.SEATED)
        steps.steps_due, steps.heard_at = 0, steps.now
        steps.pace.set(steps.pace.speed, steps.now)
        steps.use()

    def _speed(self, asked: Control) -> None:
        self._pace_set(asked.speed)
        if not self.steps.pace.realtime:  # lockstep does not wait for the clock
            self.steps.use()

    def _step(self, _: Control) -> None:
        if self.steps.state is not Phase.PAUSED:
            raise Refused("single steps need a paused simulation; pause it first")
        self.steps.steps_due += 1
        self.steps.use()

    def _reset(self, _: Control) -> None:
        self._refuse_ending()
        if self.steps.simulation.finished:
            raise Refused("the run is finished")
        self.steps.apply(Entry(0.0, 0.0, self.steps.seat.driver, "reset"))

    def _begin(self, asked: Control) -> None:
        self._refuse_ending()
        self.steps.begin(self.steps.simulation.anew(asked.seed, f"{self._root}.{self._suffix()}"))

    def _stop(self, _: Control) -> None:
        """Wait for the answer to the present tick, but not for long, and end."""
        self._stand(Given.STOP)
        self._stop_by = min(self._stop_by, self.steps.now + ANSWERED_WITHIN_S)

    def _refuse_ending(self) -> None:
        if self.steps.state in (Phase.ENDING, Phase.ENDED):
            raise Refused("the simulation is about to end")

    def _pace_set(self, speed: float) -> None:
        """Set the speed. In real time the readings are listened to, to tell slow sensors from a slow agent."""
        steps = self.steps
        steps.pace.set(speed, steps.now)
        steps.out.append(Listen(self._topics.readings, steps.pace.realtime))

    def _status(self) -> Status:
        steps, now = self.steps, self.steps.now
        waited = now - steps.question.asked_at
        return steps.report.status(
            steps.simulation, steps.seat, steps.pace, steps.lateness, steps.state, waited, not steps.unanswered,
            steps.pace.wait(now),
        )  # fmt: skip

    def _announce(self) -> None:
        steps = self.steps
        if steps.state is not Phase.FINISHED:
            steps.report.measure(steps.now, steps.tick)
        steps.report.due_at = steps.now + STATUS_EVERY_S
        status = self._status()
        if news := steps.report.news(status):
            steps.out.append(Say(news))
        steps.out.append(Publish("status", status))

    def _end(self) -> None:
        """Record the present tick, say how it stands, and stop."""
        if self.steps.state is not Phase.ENDED:
            self.steps.record(self.steps.simulation.watched)
            self.steps.out.append(Flush())
            self._announce()
            self.steps.phase.take(Given.END)
            self.steps.out.append(Stop())
