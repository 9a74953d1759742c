"""The three messages of one step for N robots. Their columns are little-endian arrays whose last axis is N."""

from phototaxis.wire.messages.base import Count, Message, Name


class BatchState(Message, kw_only=True):
    """The worlds of N robots at one tick. Columns are little-endian arrays with N as the last axis."""

    run: Name
    """Name of the run that this tick belongs to."""
    tick: Count
    """Number of the tick, from 0, which all robots share; it increases for the whole life of a run."""
    epoch: Count
    """Number of motor commands that have been applied to all robots so far in this run."""
    time: float
    """Simulated time since the run began, in seconds."""
    episode: bytes
    """Array (N,) of int64: number of each robot's present episode, from 0."""
    pose: bytes
    """Array (3, N) of float64: x and y of each robot's centre in metres, and its heading in radians."""
    contact: bytes
    """Array (2, N) of uint8: 1 where the front or the rear half touched something in the last control period."""
    left: bytes
    """Array (N,) of float64: each left wheel's command in the last control period, from −1 to 1 of full speed."""
    right: bytes
    """Array (N,) of float64: each right wheel's command in the last control period, from −1 to 1 of full speed."""
    author: Name
    """Name of the agent that gave the last commands; "" for none."""
    driver: Name
    """Name of the agent that holds the seat and must answer this tick; "" while the seat is free."""
    hash: str
    """Hash of all states of the run up to this one, 16 hexadecimal digits; equal hashes mean equal trajectories."""


class BatchReadings(Message, kw_only=True):
    """What N robots sense at one tick. Columns are little-endian arrays with N as the last axis."""

    run: Name
    """Name of the run that the sensed states belong to."""
    tick: Count
    """Number of the tick whose states were sensed."""
    epoch: Count
    """Number of motor commands applied to all robots so far in this run, as in the state."""
    episode: bytes
    """Array (N,) of int64: number of each robot's present episode, as in the state."""
    sonar: bytes
    """Array (16, N) of float64: ranges of each robot's sonars in metres, from 0 to the arena's sonar range."""
    light: bytes
    """Array (2, N) of float64: brightness at the front-left and the front-right light sensors, from 0 to 1."""
    contact: bytes
    """Array (2, N) of uint8: 1 where the front or the rear bumper was touched in the last control period."""
    left: bytes
    """Array (N,) of float64: each left wheel's command that led to these readings, from −1 to 1 of full speed."""
    right: bytes
    """Array (N,) of float64: each right wheel's command that led to these readings, from −1 to 1 of full speed."""
    author: Name
    """Name of the agent whose commands led to these readings; "" for none."""
    driver: Name
    """Name of the agent that must answer these readings; "" while the seat is free."""


class BatchCommand(Message, kw_only=True):
    """The seated agent's answer for N robots at one tick. Columns are little-endian arrays."""

    run: Name
    """Name of the run that the answered readings belong to."""
    tick: Count
    """Number of the tick that these commands answer."""
    author: Name
    """Name of the agent that gives the commands; the simulation ignores everyone but the driver."""
    end: bytes
    """Array (N,) of uint8: 0 to drive on; 1 terminated, 2 truncated, 3 reset to end the episode and begin another."""
    left: bytes
    """Array (N,) of float64: command of each left wheel for one control period, from −1 to 1 of full speed."""
    right: bytes
    """Array (N,) of float64: command of each right wheel for one control period, from −1 to 1 of full speed."""
