"""A lockstep simulation in few lines: the harness's counterpart of agents and sensors in their simulated tests.

It keeps nothing on disk, so it is never killed.
"""

from phototaxis.codec import Refused
from phototaxis.machine import Effect, Event, Publish, Reply
from phototaxis.messages import Command, Control, ControlReply, Status
from phototaxis.protocol import Question
from phototaxis_sim.seat import Seat
from phototaxis_sim.simulation import Simulation


class Asker:
    """Asks each tick until the driver's command comes, applies it, and hands over at tick boundaries.

    Attributes
    ----------
    applied : the author of the command at each tick, and who held the seat then.
    hashes : the chained hash of each tick.
    finished : whether the last tick has been answered.
    """

    def __init__(self, simulation: Simulation):
        self.simulation, self.seat, self.question = simulation, Seat(), Question()
        self.applied: list[tuple[str, str]] = []
        self.hashes = [simulation.state.hash]
        self.finished = False

    @property
    def deadline(self) -> float:
        return float("inf") if self.finished else self.question.repeat_at

    def on(self, event: Event, now: float) -> list[Effect]:
        if event.topic == "world" and event.reply:
            return [Reply(event.reply, self.simulation.world)]
        if event.topic == "control" and event.reply:
            return self._control(event.message, event.reply, now)
        if event.topic == "command":
            return self._command(event.message, now)
        if event.topic == "gone" and event.message[0] == "agent":
            return self._ask(now) if self.seat.leave(event.message[1], self.simulation.state.tick) else []
        if event.topic == "start":
            return self._ask(now)
        return [self._state()] if not self.finished and self.question.due(now) else []

    def _control(self, asked: Control, reply, now: float) -> list[Effect]:
        seat, tick, driver = self.seat, self.simulation.state.tick, self.seat.driver
        reason = ""
        try:
            if asked.verb == "claim":
                seat.claim(asked.agent, tick)
            elif asked.verb == "stand by":
                seat.stand_by(asked.agent, tick)
            elif asked.verb == "take over":
                seat.reserve(asked.agent, asked.at)
                if not seat.driver:
                    seat.boundary(tick)
            elif asked.verb == "release":
                seat.leave(asked.agent, tick)
        except Refused as why:
            reason = str(why)
        run = self.simulation.world.run
        status = Status(run=run, phase="running", tick=tick, driver=seat.driver, drivers=seat.history)
        answer = Reply(reply, ControlReply(ok=not reason, reason=reason, status=status))
        return [answer, *(self._ask(now) if seat.driver != driver else [])]

    def _command(self, command: Command, now: float) -> list[Effect]:
        state, driver = self.simulation.state, self.seat.driver
        if (command.run, command.tick, command.author) != (state.run, state.tick, driver) or self.finished:
            return []
        if self.simulation.finished:
            self.finished = True
            return []
        self.applied.append((command.author, driver))
        self.simulation.advance(command.left, command.right, command.author, command.end)
        self.hashes.append(self.simulation.state.hash)
        self.seat.boundary(self.simulation.state.tick)
        return self._ask(now)

    def _ask(self, now: float) -> list[Effect]:
        self.question.asked(now)
        return [self._state()]

    def _state(self) -> Effect:
        self.simulation.state.driver = self.seat.driver
        return Publish("state", self.simulation.state)
