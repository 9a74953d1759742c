"""Makes the status of a run: which components are present, how fast it goes, what is wrong."""

from collections import Counter, deque

from phototaxis.runtime.machine import Refusal
from phototaxis.wire.messages import RecordingProgress, Status

from phototaxis_sim.lateness import Lateness
from phototaxis_sim.pace import Pace
from phototaxis_sim.phases import Phase
from phototaxis_sim.seat import Seat
from phototaxis_sim.simulated import Simulated

STATUS_EVERY_S = 0.2
WAITS_AFTER_S = 0.5
"""Seconds without an answer after which the status says "waiting" and names the late component."""
MAX_RECENT = 50
"""Ended episodes whose outcomes count as recent."""
_NEEDED = ("sensors", "agent")


class Report:
    """Collects the contents of the status.

    Attributes
    ----------
    alive : "role/id" of every component on the bus.
    refused : how many messages were dropped, by topic and reason.
    recent : whether the last ended episodes reached the light.
    recorded : the newest progress message of the recorder.
    sensed : the newest tick whose readings came; None until there are any.
    unkept : why the journal was given up; "" if it was not.
    due_at : when the next status is due.
    """

    def __init__(self) -> None:
        self.alive: set[str] = set()
        self.refused: Counter[str] = Counter()
        self.recent: deque[bool] = deque(maxlen=MAX_RECENT)
        self.recorded: RecordingProgress | None = None
        self.sensed: int | None = None
        self.unkept, self.due_at = "", 0.0
        self._told_slow = False
        self.begin()

    def begin(self) -> None:
        """A new run: nothing is measured yet."""
        self.recent.clear()
        self.started: tuple[float, int] | None = None
        self._rate_at = self._rate = self._mean_rate = 0.0
        self._rate_tick, self.sensed = 0, None

    def refuse(self, refusal: Refusal) -> None:
        """Count a message that was dropped, by the words before the colon."""
        self.refused[f"{refusal.topic}: {refusal.why.split(':')[0]}"] += 1

    def measure(self, now: float, tick: int) -> None:
        """Measure the speed of the run, unless it is finished."""
        if now - self._rate_at >= 1.0:
            self._rate = (tick - self._rate_tick) / (now - self._rate_at) if self._rate_at else 0.0
            self._rate_at, self._rate_tick = now, tick
        if self.started is not None:
            since, first = self.started
            self._mean_rate = (tick - first) / max(now - since, 1e-9)

    def too_slow(self, lateness: Lateness, driver: str) -> str:
        """Which part cannot keep up with real time, in words; "" when all can."""
        sensors = next((who.split("/")[1] for who in sorted(self.alive) if who.startswith("sensors/")), "the sensors")
        return lateness.told(driver or "the agent", sensors)

    def news(self, status: Status) -> str:
        """The line that says a part has become too slow; "" where that is no news."""
        was, self._told_slow = self._told_slow, bool(status.too_slow)
        return f"at {status.speed:g} × real time {status.too_slow}" if status.too_slow and not was else ""

    def waits_for(self, phase: Phase, driver: str, answered: bool, overdue: bool) -> str:
        """Which component or command the run waits for, in words; "" while it goes on."""
        if phase in (Phase.PAUSED, Phase.ENDING):
            return f"the command of {driver}" if driver and not answered else ""
        if phase is Phase.FINISHED:
            return ""
        if missing := [role for role in _NEEDED if not any(who.startswith(f"{role}/") for who in self.alive)]:
            return " and ".join(missing)
        if not driver:
            return "an agent to take the seat"
        return f"the command of {driver}" if overdue and not answered else ""

    def status(
        self,
        sim: Simulated,
        seat: Seat,
        pace: Pace,
        lateness: Lateness,
        phase: Phase,
        waited: float,
        answered: bool,
        pause: float,
    ) -> Status:
        """The message. `waited`: seconds since the tick was asked; `pause`: seconds until it ends by the clock."""
        state, recorded = sim.state, self.recorded
        whom = self.waits_for(phase, seat.driver, answered, waited > max(WAITS_AFTER_S, 2 * pause))
        running = phase in (Phase.WAITING, Phase.ASKING)
        warned = recorded.warning if recorded is not None and recorded.run == sim.world.run else ""
        told = "waiting" if whom else "running"
        if not running:
            told = "finished" if phase is Phase.FINISHED else "paused"
        return Status(
            run=sim.world.run, phase=told,
            waiting_for=whom, waited=waited if running and whom else 0.0, speed=pace.speed,
            tick=state.tick, epoch=state.epoch, epochs=sim.world.epochs, episode=sim.watched.episode,
            episodes=sim.episodes, reached=sim.reached,
            recent=sum(self.recent) / len(self.recent) if self.recent else 0.0,
            rate=self._rate, mean_rate=self._mean_rate, driver=seat.driver, drivers=seat.history, next=seat.waiting,
            alive=sorted(self.alive), late=lateness.ticks, late_sensors=lateness.unsensed,
            too_slow=self.too_slow(lateness, seat.driver) if pace.realtime else "",
            refused=dict(self.refused), hash=state.hash,
            warnings=[fault for fault in (self.unkept, warned) if fault],
        )  # fmt: skip
