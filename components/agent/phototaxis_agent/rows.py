"""Makes the agent's log: a row for each tick, and now and then all its values."""

import time
from collections.abc import Callable
from typing import Any

from phototaxis.runtime.machine import Record
from phototaxis.runtime.seated import SeatedAgent
from phototaxis.wire.messages import AgentLog

TABLE_EVERY_S = 0.5


def row(agent: SeatedAgent) -> Record:
    """What the newest tick was for the agent."""
    run, tick = agent.tick
    return Record((agent, run), (tick, *agent.last))


class AgentLogs:
    """Makes the chunks of the agent's log."""

    def __init__(self, ident: str, clock: Callable[[], float] = time.monotonic):
        self._ident, self._clock, self._table_at = ident, clock, 0.0

    def __call__(self, seq: int, head: tuple[Any, ...], columns: list[tuple[Any, ...]]) -> AgentLog:
        agent, run = head
        tick, state, action, reward, error, temperature = map(list, columns)
        log = AgentLog(
            run=run, seq=seq, writer=self._ident, learner=agent.name, percept=agent.task.percept,
            tick=tick, state=state, action=action, reward=reward, td_error=error, temperature=temperature,
        )  # fmt: skip
        now = self._clock()
        if now >= self._table_at:
            self._table_at = now + TABLE_EVERY_S
            log.values, log.visits, log.current = agent.table(), list(agent.visits), agent.current()
        return log
