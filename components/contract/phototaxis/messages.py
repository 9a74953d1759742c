"""The messages of the bus: typed, validated on arrival, MessagePack on the wire and JSON accepted.

Units are metres, radians and seconds. `(run, tick)` names everything that belongs to one step; ticks
increase for the whole life of a run. Encoded, every message is a map that carries `schema`.
"""

import secrets
from datetime import datetime
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from phototaxis.arena import Arena

SCHEMA = 1
"""Version of the message schema; both sides of a bus must have the same."""

MOST = 4096
"""Robots that a world may have."""

Motor = Annotated[float, Meta(ge=-1, le=1)]
Name = Annotated[str, Meta(max_length=64, pattern=r"^[A-Za-z0-9_.-]*$")]
Count = Annotated[int, Meta(ge=0, le=2**53)]
"""What JSON readers of all languages keep exactly."""
Seed = Count

End = Literal["", "terminated", "truncated", "reset"]
"""How an episode ends: not at all, at the light, after its full number of steps, or by request."""


class Message(Struct, forbid_unknown_fields=True, kw_only=True):
    """What all messages share."""

    schema: int = SCHEMA


def run_name() -> str:
    """A fresh name for a run: date, time and four random letters."""
    return f"{datetime.now():%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"


class World(Message):
    """What does not change during a run: who, where, how long."""

    run: Name
    arena: Arena
    seed: Seed
    epochs: Count
    """Learning steps after which the run is finished; 0: it goes on until it is stopped."""
    robots: Annotated[int, Meta(ge=1, le=MOST)] = 1
    """How many robots there are, each alone in an arena of its own; with more than one the messages `…OfMany` are
    used."""


class State(Message):
    """The world at one tick: the question that sensors and agent answer."""

    run: Name
    tick: Count
    episode: Count
    epoch: Count
    """Motor commands applied so far in this run."""
    time: float
    x: float
    y: float
    heading: float
    speed: float
    """Forward velocity at the end of the control period, m/s."""
    turn: float
    """Rate of turn at the end of the control period, rad/s."""
    front: bool
    """The front half of the body touched something during the last control period."""
    rear: bool
    left: Motor
    """The command just applied, and who gave it ("" for none: an episode begins, or the motors were stopped)."""
    right: Motor
    author: Name
    driver: Name
    """Who holds the seat ("" for nobody)."""
    hash: str
    """Chained over all states of the run: equal hashes, equal trajectories."""


class Readings(Message):
    """What the robot senses at one tick."""

    run: Name
    tick: Count
    episode: Count
    epoch: Count
    sonar: Annotated[list[float], Meta(min_length=16, max_length=16)]
    """Ranges in metres, at most the sonar range."""
    light: tuple[Annotated[float, Meta(ge=0, le=1)], Annotated[float, Meta(ge=0, le=1)]]
    """Front left, front right."""
    front: bool
    """Bumpers: contact during the last control period."""
    rear: bool
    left: Motor
    """Echo of the state: the command just applied, its author, and who holds the seat."""
    right: Motor
    author: Name
    driver: Name


class Command(Message):
    """The seated agent's answer to one tick."""

    run: Name
    tick: Count
    author: Name
    left: Motor
    right: Motor
    end: End = ""
    """Not "": end the episode instead of moving; the next tick begins a new one at a fresh placement."""


class StateOfMany(Message):
    """The worlds of N robots at one tick. Columns are little-endian arrays with N as the last axis."""

    run: Name
    tick: Count
    epoch: Count
    """Motor commands applied so far in this run, to all robots."""
    time: float
    episode: bytes
    """(N,) int64: each robot's own count."""
    pose: bytes
    """(3, N) float64: x, y, heading."""
    contact: bytes
    """(2, N) uint8: front and rear, during the last control period."""
    left: bytes
    """(N,) float64: the command just applied, and who gave it ("" for none)."""
    right: bytes
    author: Name
    driver: Name
    hash: str
    """Chained over all states of the run."""


class ReadingsOfMany(Message):
    """What N robots sense at one tick. Columns are little-endian arrays with N as the last axis."""

    run: Name
    tick: Count
    epoch: Count
    episode: bytes
    """(N,) int64."""
    sonar: bytes
    """(16, N) float64, m."""
    light: bytes
    """(2, N) float64, 0..1: front left, front right."""
    contact: bytes
    """(2, N) uint8: front and rear bumper."""
    left: bytes
    """(N,) float64: echo of the state, with author and driver."""
    right: bytes
    author: Name
    driver: Name


class CommandOfMany(Message):
    """The seated agent's answer for N robots at one tick. Columns are little-endian arrays."""

    run: Name
    tick: Count
    author: Name
    left: bytes
    """(N,) float64 in −1..1."""
    right: bytes
    end: bytes
    """(N,) uint8: 0 drive on, else the episode's end, after which the robot is placed anew: 1 terminated, 2 truncated,
    3 reset."""


class EndedEpisode(Message):
    """One episode, when it has ended."""

    run: Name
    episode: Count
    tick: Count
    """The last tick of the episode."""
    steps: Count
    end: End
    driver: Name
    x: float
    """Where it started."""
    y: float
    heading: float


How = Literal["claimed", "took over", "stood by"]


class Seating(Struct, forbid_unknown_fields=True):
    """Who drives from a tick on, and how it came to the seat."""

    driver: Name
    tick: Count
    how: How


Phase = Literal["waiting", "running", "paused", "finished"]


class Status(Message):
    """How the run is doing, several times a second."""

    run: Name
    phase: Phase
    waiting_for: str = ""
    """Whom a waiting simulation waits for; of a paused one, whose answer to the present tick is not there yet."""
    waited: float = 0.0
    """Seconds without an answer."""
    speed: float = 0.0
    """0: lockstep, as fast as the answers come; else simulated seconds per second."""
    tick: Count = 0
    epoch: Count = 0
    epochs: Count = 0
    episode: Count = 0
    episodes: Count = 0
    """Episodes that have ended."""
    reached: Count = 0
    """Episodes that ended at the light."""
    recent: float = 0.0
    """Share of the last 50 ended episodes that reached the light."""
    rate: float = 0.0
    """Ticks a second over the last second."""
    mean_rate: float = 0.0
    """Ticks a second since the first answer (of this simulation process)."""
    driver: Name = ""
    drivers: list[Seating] = field(default_factory=list)
    """Who held the seat since when, the newest last (of this simulation process; at most 50)."""
    next: list[Name] = field(default_factory=list)
    """Who will or would drive next: takers-over by their tick, then standbys."""
    alive: list[str] = field(default_factory=list)
    """"role/id" of every component whose token is on the bus."""
    late: Count = 0
    """Ticks that ended by the clock before their command came, in real time (of this simulation process)."""
    late_sensors: Count = 0
    """In how many of them the readings had not come either: the sensors were too slow, not the agent."""
    too_slow: str = ""
    """Which part cannot keep up with the speed now, in words; "" when all can."""
    refused: dict[str, int] = field(default_factory=dict)
    """Messages refused or ignored by the simulation, by reason."""
    hash: str = ""
    warnings: list[str] = field(default_factory=list)
    """What is wrong and does not stop the run, such as a recording that was cut short."""


class Recorded(Message):
    """How far the recording of a run is, once a second."""

    run: Name
    tick: Annotated[int, Meta(ge=-1)] = -1
    """The newest tick that is on disk; −1 for none."""
    warning: str = ""
    """Why nothing more is written to disk, or soon will not be, in a line; "" while all is well."""


class Control(Message):
    """A request to the simulation."""

    verb: Literal[
        "status", "pause", "resume", "step", "speed", "reset", "begin", "stop",
        "claim", "take over", "stand by", "release",
    ]  # fmt: skip
    """begin: a new run with `seed`; who drives, drives on. claim: sit down on a free seat. take over: at the first
    tick boundary from tick `at` on. stand by: when nobody else drives any more. release: leave the seat, or the
    queue for it."""
    agent: Name = ""
    """Of the last four verbs: whose seat."""
    at: Count = 0
    """take over: from which tick on."""
    speed: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """speed: 0 is lockstep."""
    seed: Seed = 0
    """begin: of the new run."""


class ControlReply(Message):
    """What the simulation says to a request."""

    ok: bool
    reason: str
    status: Status


class CheckpointRequest(Message):
    """A successor asks an agent for everything it needs to continue bit for bit."""

    agent: Name
    """Who is asked; the others keep silent."""
    learner: str
    """Of the successor; another learner or percept is refused without sending anything."""
    percept: str
    probe: bool = False
    """Only say whether it fits."""


class CheckpointReply(Message):
    """What an agent says to its successor."""

    reason: str = ""
    """Why it does not fit; then there are no data."""
    data: bytes = b""
    """A checkpoint file: a NumPy .npz without pickles."""


class Launch(Message):
    """A request to the launcher: start an agent that takes the seat over."""

    words: Annotated[list[Annotated[str, Meta(max_length=1000)]], Meta(max_length=100)]
    """Options of `phototaxis agent`: the learner and its hyperparameters."""


class LaunchReply(Message):
    """What the launcher says."""

    reason: str = ""
    """Why nothing came of it; "" when the new agent drives."""
    agent: Name = ""
    """Name of the new agent."""
    tick: Count = 0
    """It drives from this tick on."""


Column = list[float]
ENDS: tuple[End, ...] = ("", "terminated", "truncated", "reset")
"""By the number that `CommandOfMany` has for them."""


Ticks = Annotated[list[Count], Meta(min_length=1)]


def _check_columns(log: Any, **widths: int) -> None:
    """Raise ValueError where a column has not so many values for each tick."""
    for name, width in widths.items():
        if len(getattr(log, name)) != width * len(log.tick):
            raise ValueError(f"{name} has {len(getattr(log, name))} values for {len(log.tick)} ticks")


class SimLog(Message):
    """Poses, commands and ended episodes of consecutive ticks, in columns."""

    run: Name
    seq: Count
    writer: Name
    driver: Name
    tick: Ticks
    episode: list[int]
    time: Column
    x: Column
    y: Column
    heading: Column
    left: Column
    right: Column
    contact: list[int]
    """0 none, 1 front, 2 rear, 3 both."""
    ended: list[EndedEpisode]
    late: Count = 0
    """Ticks so far that ended by the clock before their command came, as in the status."""

    def __post_init__(self) -> None:
        _check_columns(self, episode=1, time=1, x=1, y=1, heading=1, left=1, right=1, contact=1)


class SensorsLog(Message):
    """Readings of consecutive ticks, in columns; sonar and light are flattened row by row (16 and 2 a tick)."""

    run: Name
    seq: Count
    writer: Name
    sonar_model: str
    """Which model the ranges come from: "built-in", or the file of an FMU."""
    light_model: str
    tick: Ticks
    sonar: Column
    light: Column

    def __post_init__(self) -> None:
        _check_columns(self, sonar=16, light=2)


class AgentLog(Message):
    """What the agent perceived, chose and learned at consecutive ticks, in columns."""

    run: Name
    seq: Count
    writer: Name
    learner: str
    percept: str
    """Name of the percept."""
    tick: Ticks
    state: list[int]
    """Number of the percept's state."""
    action: list[int]
    """Index of the action; −1 where the agent ended the episode."""
    reward: Column
    td_error: Column
    temperature: Column
    values: Column = field(default_factory=list)
    """At a modest rate: Q(state, action), flattened row by row, 9 actions a row; else empty."""
    visits: list[int] = field(default_factory=list)
    """With `values`: how often each state was met."""
    current: Column = field(default_factory=list)
    """At the same rate, for any percept: Q of the percept at the newest tick, 9 actions, 0 where not allowed."""

    def __post_init__(self) -> None:
        _check_columns(self, state=1, action=1, reward=1, td_error=1, temperature=1)


class LogRequest(Message):
    """Asks a component for the log chunks it still has, from `seq` on."""

    seq: Count = 0
    writer: Name = ""
    """Who is asked; "" for everyone."""
