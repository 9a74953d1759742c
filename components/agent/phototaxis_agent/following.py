"""Whom a waiting agent follows, what it asks of that one, and how it becomes its equal."""

import math
from typing import Literal

from phototaxis.runtime.checkpoint import decode, encode
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.machine import Answer, Ask, Effect, Say
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.wire.messages import BatchReadings, CheckpointReply, CheckpointRequest, Readings

INHERIT_WITHIN_S = 4.0
"""Time that a predecessor gets to hand over its state, and that a standby waits before it asks again."""
ASK_AGAIN_S = 0.5
"""Pause before an unanswered question is repeated, since it may be lost; an absent agent is reported at once."""
TAG = "inherit"

Outcome = Literal["same kind", "another kind", "inherited", "nothing"]
"""What came of a question: the first two of a probe, the others of the question for everything."""


class Following:
    """The agent that drives in one run, as one that waits for its seat sees it.

    Attributes
    ----------
    again_at : when the question that is out is put once more; infinity for never.
    leader : the driver that is followed, once a command of it was applied: it has nothing to ask of us any more.
    related : whether the leader has the same learner and percept, None while it does not answer.
    """

    def __init__(self, run: str, agent: SeatedAgent):
        self._run, self._agent = run, agent
        self.leader = self._named = ""
        self.related: bool | None = False
        self._asked: Ask | None = None
        self._probe = False
        self._retry_at = self._until = -math.inf
        self.again_at = math.inf

    @property
    def probes(self) -> bool:
        """Whether the leader is being asked what kind it is."""
        return self._asked is not None and self._probe

    @property
    def inherits(self) -> bool:
        """Whether an agent is being asked for everything that it knows."""
        return self._asked is not None and not self._probe

    def see(self, readings: Readings | BatchReadings) -> bool:
        """Note the driver that the readings name; return whether it is a new leader."""
        self._named = readings.driver
        fresh = readings.driver != self.leader and readings.author == readings.driver
        if fresh:
            self.leader, self._retry_at = readings.driver, -math.inf
        return fresh

    def due(self, now: float) -> bool:
        """Whether the leader's state, or its kind while that is not known, is worth asking for."""
        return self.related is not False and now >= self._retry_at

    def ask(self, whom: str, now: float, probe: bool = False) -> list[Effect]:
        """Ask an agent for its checkpoint; with `probe` only whether it would fit."""
        request = CheckpointRequest(agent=whom, learner=self._agent.name, percept=self._agent.task.percept, probe=probe)
        tag = f"{TAG} {self._run} {whom} {now}"
        self._asked, self._probe = Ask(tag, "checkpoint", request, INHERIT_WITHIN_S, agent=whom), probe
        self._until, self.again_at = now + INHERIT_WITHIN_S, now + ASK_AGAIN_S
        return [self._asked]

    def again(self, now: float) -> list[Effect]:
        """Put the question that is out once more, where that is due; the first answer to any of them counts."""
        left = self._until - now
        if self._asked is None or now < self.again_at:
            return []
        self.again_at = now + ASK_AGAIN_S if left > ASK_AGAIN_S else math.inf
        return [self._asked._replace(timeout=left)] if left > 0 else []

    def predecessor_at(self, readings: Readings | BatchReadings) -> str:
        """Name the agent to inherit from when we get the seat; "" if we drove last.

        The author of the last command has learned everything before it. A driver that was named but gave no command
        has nothing of its own.
        """
        named, self._named = self._named, ""
        known = readings.author or named
        return "" if known == self._agent.author else known

    def answered(self, answer: Answer, now: float) -> tuple[Outcome | None, list[Effect]]:
        """What an answer brings; None when it belongs to an earlier question or another run."""
        asked, reply = self._asked, answer.first
        if asked is None or answer.tag != asked.tag:
            return None, []
        self._asked, self.again_at = None, math.inf
        if reply is None:
            self._retry_at = now + INHERIT_WITHIN_S
        if self._probe:
            self.related = None if reply is None else not reply.reason
            return "same kind" if self.related else "another kind", []
        fault = self._inherit(reply, asked.agent)
        if fault is None:
            return "inherited", [Say(f"inherited what {asked.agent} knew at tick {self._agent.tick[1]}")]
        self._retry_at = now + INHERIT_WITHIN_S
        return "nothing", [Say(fault)]

    def _inherit(self, reply: CheckpointReply | None, source: str) -> str | None:
        """Become what the other one is; why not, in a line."""
        if reply is None or reply.reason:
            return f"inherited nothing: {source} {'does not answer' if reply is None else reply.reason}"
        try:
            meta, arrays = decode(reply.data, source)
            if meta.run != self._run:
                return f"inherited nothing: {source} has not driven in this run"
            self._agent.restore(meta, arrays, source)
        except UserError as error:
            return str(error)
        return None


def bequest(agent: SeatedAgent | None, request: CheckpointRequest) -> CheckpointReply:
    """What a successor is told: all that it needs to continue, or why that does not fit."""
    if agent is None:
        return CheckpointReply(reason="knows nothing yet")
    if (request.learner, request.percept) != (agent.name, agent.task.percept):
        return CheckpointReply(reason=f"is {agent.name} with the percept {agent.task.percept}")
    return CheckpointReply() if request.probe else CheckpointReply(data=encode(*agent.checkpoint()))
