"""The three messages of one step for one robot: the question, what is sensed, and the answer."""

from typing import Annotated

from msgspec import Meta

from phototaxis.wire.messages.base import Count, End, Message, Motor, Name


class State(Message, kw_only=True):
    """The world of one robot at one tick: the question that sensors and agent answer."""

    run: Name
    """Name of the run that this tick belongs to."""
    tick: Count
    """Number of the tick, from 0; it increases for the whole life of a run."""
    episode: Count
    """Number of the present episode, from 0."""
    epoch: Count
    """Number of motor commands that have been applied so far in this run."""
    time: float
    """Simulated time since the run began, in seconds."""
    x: float
    """Distance from the west wall to the robot's centre, in metres."""
    y: float
    """Distance from the south wall to the robot's centre, in metres."""
    heading: float
    """Direction that the robot faces, in radians from −π to π, anticlockwise from east."""
    speed: float
    """Forward velocity at the end of the control period, in metres per second; negative is backwards."""
    turn: float
    """Rate of turn at the end of the control period, in radians per second, anticlockwise positive."""
    front: bool
    """Whether the front half of the body touched something during the last control period."""
    rear: bool
    """Whether the rear half of the body touched something during the last control period."""
    left: Motor
    """Command of the left wheel in the last control period, from −1 to 1 of full speed; 0 if none was applied."""
    right: Motor
    """Command of the right wheel in the last control period, from −1 to 1 of full speed; 0 if none was applied."""
    author: Name
    """Name of the agent that gave the last command; "" when a run begins or the motors were stopped."""
    driver: Name
    """Name of the agent that holds the seat and must answer this tick; "" while the seat is free."""
    hash: str
    """Hash of all states of the run up to this one, 16 hexadecimal digits; equal hashes mean equal trajectories."""


class Readings(Message, kw_only=True):
    """What one robot senses at one tick: the sensors' answer to the state, and the agent's question."""

    run: Name
    """Name of the run that the sensed state belongs to."""
    tick: Count
    """Number of the tick whose state was sensed."""
    episode: Count
    """Number of the present episode, as in the state."""
    epoch: Count
    """Number of motor commands applied so far in this run, as in the state."""
    sonar: Annotated[list[float], Meta(min_length=16, max_length=16)]
    """Ranges of the 16 sonars in metres, from 0 to the arena's sonar range, in the order of the arena's sonars."""
    light: tuple[Annotated[float, Meta(ge=0, le=1)], Annotated[float, Meta(ge=0, le=1)]]
    """Brightness at the front-left and the front-right light sensor, from 0 (dark) to 1."""
    front: bool
    """Whether the front bumper was touched during the last control period."""
    rear: bool
    """Whether the rear bumper was touched during the last control period."""
    left: Motor
    """Command of the left wheel that led to these readings, from −1 to 1 of full speed."""
    right: Motor
    """Command of the right wheel that led to these readings, from −1 to 1 of full speed."""
    author: Name
    """Name of the agent whose command led to these readings; "" for none."""
    driver: Name
    """Name of the agent that must answer these readings; "" while the seat is free."""


class Command(Message, kw_only=True):
    """The seated agent's answer to one tick: two motor commands, or the end of the episode."""

    run: Name
    """Name of the run that the answered readings belong to."""
    tick: Count
    """Number of the tick that this command answers."""
    author: Name
    """Name of the agent that gives the command; the simulation ignores everyone but the driver."""
    end: End = ""
    """How the episode ends instead of a move: "" to drive on; else the next tick begins a new episode elsewhere."""
    left: Motor
    """Command of the left wheel for one control period, from −1 to 1 of full speed."""
    right: Motor
    """Command of the right wheel for one control period, from −1 to 1 of full speed."""
