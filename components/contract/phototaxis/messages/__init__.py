"""The messages of the bus: typed, validated on arrival, MessagePack on the wire and JSON accepted.

Units are metres, radians and seconds. `(run, tick)` names everything that belongs to one step; ticks increase for the
whole life of a run. Encoded, every message is a map that carries `schema`. All fields are given by keyword.
"""

from phototaxis.messages.agents import CheckpointReply, CheckpointRequest, Launch, LaunchReply
from phototaxis.messages.base import ENDS, MAX_ROBOTS, SCHEMA, Count, End, Message, Motor, Name, Seed
from phototaxis.messages.control import Control, ControlReply
from phototaxis.messages.logs import AgentLog, Log, LogRequest, SensorsLog, SimLog
from phototaxis.messages.many import CommandOfMany, ReadingsOfMany, StateOfMany
from phototaxis.messages.run import EndedEpisode, How, Phase, Recorded, Seating, Status, World, run_name
from phototaxis.messages.step import Command, Readings, State

__all__ = [
    "ENDS",
    "MAX_ROBOTS",
    "SCHEMA",
    "AgentLog",
    "CheckpointReply",
    "CheckpointRequest",
    "Command",
    "CommandOfMany",
    "Control",
    "ControlReply",
    "Count",
    "End",
    "EndedEpisode",
    "How",
    "Launch",
    "LaunchReply",
    "Log",
    "LogRequest",
    "Message",
    "Motor",
    "Name",
    "Phase",
    "Readings",
    "ReadingsOfMany",
    "Recorded",
    "Seating",
    "Seed",
    "SensorsLog",
    "SimLog",
    "State",
    "StateOfMany",
    "Status",
    "World",
    "run_name",
]
