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
    """Answers a tick once; the same question again gets the remembered answer, an older one None.

    `answer` is called with a message that has `run` and `tick`. Who continues for another one is given the
    run and tick that were answered last, and the answer.
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
    """The simulation's side: when an unanswered tick is to be asked again, and since when it waits.

    Times are seconds of a monotonic clock. The first repeat comes after `first` seconds; the pause
    doubles up to `most`, so that a slow learner is not flooded.
    """

    def __init__(self, first: float = 0.05, most: float = 0.4):
        self._first, self._most = first, most
        self.asked_at = 0.0
        self.repeat_at = 0.0
        self._pause = first

    def asked(self, now: float) -> None:
        """A new tick has been asked."""
        self.asked_at = now
        self._pause = self._first
        self.repeat_at = now + self._pause

    def due(self, now: float) -> bool:
        """Whether to ask again now; if so the next repeat is planned."""
        if now < self.repeat_at:
            return False
        self._pause = min(2 * self._pause, self._most)
        self.repeat_at = now + self._pause
        return True
