"""Requests to swap the learner: each starts an agent, and gets its reply when that agent drives or fails."""

from phototaxis.runtime.machine import Event
from phototaxis.wire.messages import LaunchReply, LaunchRequest, Status

from phototaxis_launcher.child import Child
from phototaxis_launcher.processes import Processes
from phototaxis_launcher.progress import Progress


class SwapRequests:
    """The swap requests that wait for a reply."""

    def __init__(self, processes: Processes, progress: Progress):
        self._processes, self._progress = processes, progress
        self._pending: list[tuple[Child, Event]] = []

    def begin(self, event: Event) -> None:
        """Start the agent that a request asks for."""
        request: LaunchRequest | None = event.message
        if request is None or event.reply is None:
            return
        child = self._processes.another_agent(request.words)
        self._pending.append((child, event))
        self._progress.say(f"swap requested: {child.name} starts")

    def confirm(self, status: Status) -> None:
        """Reply to the requests whose agent has become the driver."""
        for child, _ in list(self._pending):
            for seating in status.drivers:
                if seating.driver in child.idents:
                    self._answer(child, LaunchReply(agent=seating.driver, tick=seating.tick))

    def fail(self, child: Child, why: str) -> bool:
        """Reply to the request for this agent why it does not drive, and drop the agent; False if there is none."""
        if not self._answer(child, LaunchReply(reason=why)):
            return False
        self._progress.say(why)
        self._processes.agents.remove(child)
        return True

    def _answer(self, child: Child, reply: LaunchReply) -> bool:
        asked = [event for one, event in self._pending if one is child]
        for event in asked:
            if event.reply is not None:
                event.reply(reply)
        self._pending = [(one, event) for one, event in self._pending if one is not child]
        return bool(asked)
