"""The step protocol: at-least-once delivery, idempotent answers, exactly-once learning.

The simulation is the only clock. It asks `state(t)` and repeats the question until `command(t)` comes
(`RetransmitTimer`); sensors and agent answer each tick once and repeat the same answer when asked again
(`AnswerCache`). A lost message, a late joiner and a restarted process are therefore one case, without
acknowledgements, and nobody but the simulation starts a recovery.
"""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

Answer = TypeVar("Answer")


class AnswerCache(Generic[Answer]):
    """Answers each tick once: a repeated question gets the remembered answer, an older question None.

    `answer` computes the answer to a message that has `run` and `tick`. A process that continues for another one
    passes the run, the tick and the answer that were last.
    """

    def __init__(
        self, answer: Callable[[Any], Answer], after: tuple[str, int] = ("", -1), remembered: Answer | None = None
    ):
        self._answer = answer
        self._run, self._tick = after
        self._remembered: Answer | None = remembered

    def __call__(self, question: Any) -> Answer | None:
        if question.run == self._run and question.tick <= self._tick:
            return self._remembered if question.tick == self._tick else None
        self._remembered = self._answer(question)
        self._run, self._tick = question.run, question.tick
        return self._remembered


class RetransmitTimer:
    """Decides when the simulation publishes an unanswered tick again, and since when it has waited.

    Times are seconds of a monotonic clock. The first repeat comes after `first` seconds; the pause
    doubles up to `most`, so that a slow learner is not flooded.
    """

    def __init__(self, first: float = 0.05, most: float = 0.4):
        self._first, self._most = first, most
        self.asked_at = 0.0
        self.repeat_at = 0.0
        self._pause = first

    def asked(self, now: float) -> None:
        """Note that a new tick has been published."""
        self.asked_at = now
        self._pause = self._first
        self.repeat_at = now + self._pause

    def due(self, now: float) -> bool:
        """Return whether to publish again now; if so, plan the next repeat."""
        if now < self.repeat_at:
            return False
        self._pause = min(2 * self._pause, self._most)
        self.repeat_at = now + self._pause
        return True
