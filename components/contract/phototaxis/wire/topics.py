"""The one table of topics; keys, subscriptions, limits and QoS derive from it."""

from typing import Literal, NamedTuple

from phototaxis.wire import messages as m

Kind = Literal["stream", "retained", "log", "query"]
"""How a topic is carried. stream: published; the simulation repeats a tick that gets no answer. retained: a queryable
answers with the message at any time. log: published in columns, may be dropped under congestion; a queryable answers
with the newest chunks. query: a request to the writer, which answers it."""


class Topic(NamedTuple):
    """One key of the bus."""

    name: str
    message: type[m.Message]
    writer: str
    kind: Kind
    limit: int
    """Largest accepted payload, in bytes; for a query, of the request."""
    about: str
    reply: type[m.Message] | None = None
    """Type of the answer to a query; None for topics of other kinds."""
    reply_limit: int = 0
    """Largest accepted answer to a query, in bytes."""

    def key(self, prefix: str) -> str:
        """The Zenoh key under the prefix of one world."""
        return f"{prefix}/{self.name}"


TOPICS = {
    topic.name: topic
    for topic in (
        Topic("world", m.World, "sim", "retained", 16_000_000, "the arena and all else that stays fixed during a run"),
        Topic("state", m.State, "sim", "stream", 4_096, "pose, contacts, applied command, seat holder"),
        Topic("readings", m.Readings, "sensors", "stream", 4_096, "sonars, lights, bumpers, echoed command"),
        Topic("command", m.Command, "agent", "stream", 4_096, "the answer: two motors, or the episode's end"),
        Topic("batch/state", m.BatchState, "sim", "stream", 1_000_000, "the states of many robots"),
        Topic("batch/readings", m.BatchReadings, "sensors", "stream", 2_000_000, "the readings of many robots"),
        Topic("batch/command", m.BatchCommand, "agent", "stream", 200_000, "the answer for many robots"),
        Topic("episode", m.EndedEpisode, "sim", "stream", 4_096, "summary of an episode, when it has ended"),
        Topic("status", m.Status, "sim", "stream", 32_768, "progress and health of the run, 5 times a second"),
        Topic(
            "control",
            m.Control,
            "sim",
            "query",
            4_096,
            "pause, resume, step, speed, reset, seat, stop",
            m.ControlReply,
            32_768,
        ),
        Topic(
            "checkpoint",
            m.CheckpointRequest,
            "agent",
            "query",
            4_096,
            "everything that a successor needs to continue",
            m.CheckpointReply,
            256_000_000,
        ),
        Topic(
            "launch",
            m.LaunchRequest,
            "launcher",
            "query",
            16_384,
            "start an agent that takes the seat over",
            m.LaunchReply,
            4_096,
        ),
        Topic("recording", m.RecordingProgress, "recorder", "stream", 4_096, "the recording's progress, once a second"),
        Topic("log/sim", m.SimLog, "sim", "log", 1_000_000, "poses, commands, ended episodes, in columns"),
        Topic("log/sensors", m.SensorsLog, "sensors", "log", 1_000_000, "readings, in columns"),
        Topic("log/agent", m.AgentLog, "agent", "log", 4_000_000, "percepts, actions, learning, in columns"),
    )
}


class StepTopics(NamedTuple):
    """The three topics of the step protocol."""

    state: str
    readings: str
    command: str


def step_topics(robots: int) -> StepTopics:
    """The topics of the step protocol in a world with this number of robots."""
    prefix = "batch/" if robots > 1 else ""
    return StepTopics(*(f"{prefix}{name}" for name in StepTopics._fields))


def alive_key(prefix: str, role: str, ident: str) -> str:
    """The key of a component's liveliness token."""
    return f"{prefix}/alive/{role}/{ident}"


def table() -> str:
    """The topics as a Markdown table, for the documentation."""
    rows = [
        f"| `{{name}}/{topic.name}` | {topic.message.__name__} | {topic.writer} | {topic.kind} | {topic.about} |"
        for topic in TOPICS.values()
    ]
    return "\n".join(["| key | message | writer | kind | what |", "|---|---|---|---|---|", *rows])
