"""The messages of the bus: typed, validated on arrival, MessagePack on the wire and JSON accepted.

Units are metres, radians and seconds. `(run, tick)` names everything that belongs to one step; ticks increase for the
whole life of a run. Encoded, every message is a map that carries `schema`. All fields are given by keyword.
"""

from phototaxis.wire.messages.agents import CheckpointReply, CheckpointRequest, LaunchReply, LaunchRequest
from phototaxis.wire.messages.base import ENDS, MAX_ROBOTS, SCHEMA, Count, End, Message, Motor, Name, Seed
from phototaxis.wire.messages.control import Control, ControlReply
from phototaxis.wire.messages.logs import AgentLog, Log, LogRequest, SensorsLog, SimLog
from phototaxis.wire.messages.many import BatchCommand, BatchReadings, BatchState
from phototaxis.wire.messages.run import (
    EndedEpisode,
    Phase,
    RecordingProgress,
    SeatChange,
    SeatChangeReason,
    Status,
    World,
    run_name,
)
from phototaxis.wire.messages.step import Command, Readings, State

__all__ = [
    "ENDS",
    "MAX_ROBOTS",
    "SCHEMA",
    "AgentLog",
    "BatchCommand",
    "BatchReadings",
    "BatchState",
    "CheckpointReply",
    "CheckpointRequest",
    "Command",
    "Control",
    "ControlReply",
    "Count",
    "End",
    "EndedEpisode",
    "LaunchReply",
    "LaunchRequest",
    "Log",
    "LogRequest",
    "Message",
    "Motor",
    "Name",
    "Phase",
    "Readings",
    "RecordingProgress",
    "SeatChange",
    "SeatChangeReason",
    "Seed",
    "SensorsLog",
    "SimLog",
    "State",
    "Status",
    "World",
    "run_name",
]
