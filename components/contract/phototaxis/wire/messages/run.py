"""The messages about a run as a whole: its world, its episodes, how it is doing, and how it is recorded."""

import secrets
from datetime import datetime
from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from phototaxis.geometry.arena import Arena
from phototaxis.wire.messages.base import MAX_ROBOTS, Count, End, Message, Name, Seed

SeatChangeReason = Literal["claimed", "took over", "stood by"]
"""How an agent came to the seat."""
Phase = Literal["waiting", "running", "paused", "finished"]
"""What a run is doing."""


def run_name() -> str:
    """A fresh name for a run: date, time and four random hexadecimal digits."""
    return f"{datetime.now():%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"


class World(Message, kw_only=True):
    """What does not change during a run: its name, its arena, its seed and its length."""

    run: Name
    """Name of the run, which no other run has."""
    seed: Seed
    """Seed from which the start of each episode and the noise of each tick follow."""
    epochs: Count
    """Number of motor commands after which the run is finished; 0 for a run that goes on until it is stopped."""
    robots: Annotated[int, Meta(ge=1, le=MAX_ROBOTS)] = 1
    """Number of robots, each alone in an arena of its own; above 1 the messages named `Batch…` are used."""
    arena: Arena
    """The room, its obstacles and lights, the robot's geometry and the laws of its sensors."""


class EndedEpisode(Message, kw_only=True):
    """One episode, published when it has ended. With several robots it is the first robot's."""

    run: Name
    """Name of the run that the episode belongs to."""
    episode: Count
    """Number of the episode that has ended, from 0."""
    tick: Count
    """Number of the last tick of the episode."""
    steps: Count
    """Number of motor commands that were applied during the episode."""
    end: End
    """How the episode ended: at the light, after its full number of steps, or by request."""
    driver: Name
    """Name of the agent that drove when the episode ended."""
    x: float
    """Distance from the west wall to the place where the episode started, in metres."""
    y: float
    """Distance from the south wall to the place where the episode started, in metres."""
    heading: float
    """Direction that the robot faced when the episode started, in radians, anticlockwise from east."""


class SeatChange(Struct, forbid_unknown_fields=True, kw_only=True):
    """One change of the seat: the new driver, its first tick, and how it got the seat."""

    driver: Name
    """Name of the agent that sat down."""
    tick: Count
    """Number of the first tick that this agent answers."""
    how: SeatChangeReason
    """How the agent came to the seat: it was free, it was taken over, or a standby moved up."""


class Status(Message, kw_only=True):
    """How the run is doing, published by the simulation five times a second and sent with each reply to a request."""

    run: Name
    """Name of the present run."""
    phase: Phase
    """What the run is doing now; a finished run applies no more commands."""
    waiting_for: str = ""
    """Whose answer or arrival a waiting or paused run lacks, in words; "" for nobody's."""
    waited: float = 0.0
    """Time since the present tick was first published, in seconds, while the run is waiting; else 0."""
    speed: float = 0.0
    """Pace in simulated seconds per second, from 0 to 1,000; 0 is lockstep, as fast as the answers come."""
    tick: Count = 0
    """Number of the present tick."""
    epoch: Count = 0
    """Number of motor commands that have been applied so far in this run."""
    epochs: Count = 0
    """Number of motor commands after which the run is finished; 0 for no end."""
    episode: Count = 0
    """Number of the present episode, from 0; with several robots it is the first robot's."""
    episodes: Count = 0
    """Number of episodes that have ended so far in this run."""
    reached: Count = 0
    """Number of episodes so far that ended at the light."""
    recent: float = 0.0
    """Share of the last 50 ended episodes that reached the light, from 0 to 1."""
    rate: float = 0.0
    """Ticks per second over the last second."""
    mean_rate: float = 0.0
    """Ticks per second since this simulation process applied its first command."""
    driver: Name = ""
    """Name of the agent that holds the seat; "" while the seat is free."""
    drivers: list[SeatChange] = field(default_factory=list[SeatChange])
    """The last 50 changes of the seat in this simulation process, the newest last."""
    next: list[Name] = field(default_factory=list[Name])
    """Names of the agents that drive next: first those that take over, by their tick, then the standbys."""
    alive: list[str] = field(default_factory=list[str])
    """Role and name of each component that is on the bus, written "role/name"."""
    late: Count = 0
    """Number of ticks that ended by the clock before their command came, in this simulation process."""
    late_sensors: Count = 0
    """Number of the late ticks whose readings had not come either, so that the sensors were too slow."""
    too_slow: str = ""
    """Which component cannot keep up with the present speed, in words; "" when all can."""
    refused: dict[str, int] = field(default_factory=dict[str, int])
    """Number of messages that the simulation refused or ignored, by reason."""
    hash: str = ""
    """Hash of all states of the run so far, 16 hexadecimal digits, as in the state."""
    warnings: list[str] = field(default_factory=list[str])
    """What is wrong and does not stop the run, a line each, such as a recording that was cut short."""


class RecordingProgress(Message, kw_only=True):
    """How far the recording of a run is, published by the recorder once a second."""

    run: Name
    """Name of the run that is recorded."""
    tick: Annotated[int, Meta(ge=-1)] = -1
    """Number of the newest tick that is on disk; −1 while there is none."""
    warning: str = ""
    """Why nothing more is written to disk, or soon will not be, in one line; "" while all is well."""
