"""The messages from which a run is recorded: what happened at consecutive ticks, in columns."""

from typing import Annotated

from msgspec import Meta, field

from phototaxis.wire.messages.base import Count, Message, Name
from phototaxis.wire.messages.run import EndedEpisode

Column = list[float]
"""One real number for each tick."""
Ticks = Annotated[list[Count], Meta(min_length=1)]
"""The ticks that a chunk of a log is about, at least one."""


class Log(Message, kw_only=True):
    """What all logs share: whose they are, and which ticks they are about."""

    run: Name
    """Name of the run that the ticks belong to."""
    writer: Name
    """Name of the component that wrote this chunk."""
    seq: Count
    """Number of this chunk, from 0, counted by its writer."""
    tick: Ticks
    """Numbers of the ticks that this chunk is about, in increasing order, at least one."""

    def check_columns(self, **widths: int) -> None:
        """Check that each named column has `width` values for each tick.

        Raises
        ------
        ValueError
            when a column has more or fewer.
        """
        for name, width in widths.items():
            if len(getattr(self, name)) != width * len(self.tick):
                raise ValueError(f"{name} has {len(getattr(self, name))} values for {len(self.tick)} ticks")


class SimLog(Log, kw_only=True):
    """Poses, commands and ended episodes at consecutive ticks, in columns of one value a tick."""

    driver: Name
    """Name of the agent that drove at all these ticks; "" for nobody."""
    late: Count = 0
    """Number of ticks so far that ended by the clock before their command came, as in the status."""
    episode: list[int]
    """Number of the episode that each tick belongs to."""
    time: Column
    """Simulated time of each tick since the run began, in seconds."""
    x: Column
    """Distance from the west wall to the robot's centre at each tick, in metres."""
    y: Column
    """Distance from the south wall to the robot's centre at each tick, in metres."""
    heading: Column
    """Direction that the robot faces at each tick, in radians from −π to π, anticlockwise from east."""
    left: Column
    """Command of the left wheel that led to each tick, from −1 to 1 of full speed."""
    right: Column
    """Command of the right wheel that led to each tick, from −1 to 1 of full speed."""
    contact: list[int]
    """Which half of the body touched something before each tick: 0 none, 1 the front, 2 the rear, 3 both."""
    ended: list[EndedEpisode]
    """The episodes that ended since the chunk before."""

    def __post_init__(self) -> None:
        self.check_columns(episode=1, time=1, x=1, y=1, heading=1, left=1, right=1, contact=1)


class SensorsLog(Log, kw_only=True):
    """Readings at consecutive ticks, in columns; several values a tick are flattened row by row."""

    sonar_model: str
    """Name of the model that the ranges come from: "built-in", or the file of an FMU."""
    light_model: str
    """Name of the model that the brightness comes from: "built-in", or the file of an FMU."""
    sonar: Column
    """Ranges in metres, 16 a tick, in the order of the arena's sonars."""
    light: Column
    """Brightness at the front-left and the front-right light sensor, 2 a tick, from 0 to 1."""

    def __post_init__(self) -> None:
        self.check_columns(sonar=16, light=2)


class AgentLog(Log, kw_only=True):
    """What the agent perceived, chose and learned at consecutive ticks, in columns of one value a tick."""

    learner: str
    """Name of the learner that drove."""
    percept: str
    """Name of the percept that the learner was given."""
    state: list[int]
    """Number of the percept's state at each tick; 0 where a percept consists of real numbers."""
    action: list[int]
    """Number of the action chosen at each tick, from 0 to 8; −1 where the agent ended the episode."""
    reward: Column
    """Reward that was received at each tick, in the units of the reward that the agent was given."""
    td_error: Column
    """Temporal-difference error that was learned from at each tick, in the units of the reward."""
    temperature: Column
    """Temperature of the choice among actions at each tick, in the units of the values."""
    values: Column = field(default_factory=list[float])
    """Q of each state and action, flattened row by row, 9 actions a row; empty in most chunks."""
    visits: list[int] = field(default_factory=list[int])
    """How often each state has been met, one number for each row of `values`; empty in most chunks."""
    current: Column = field(default_factory=list[float])
    """Q of the newest tick's percept for the 9 actions, 0 where an action is not allowed; empty in most chunks."""

    def __post_init__(self) -> None:
        self.check_columns(state=1, action=1, reward=1, td_error=1, temperature=1)


class LogRequest(Message, kw_only=True):
    """A request to a component for the chunks of its log that it still has."""

    writer: Name = ""
    """Name of the component that is asked; "" for all of them."""
    seq: Count = 0
    """Number of the first chunk that is wanted."""
