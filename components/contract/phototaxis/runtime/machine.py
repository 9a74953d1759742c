"""The interface of a machine: a class that only decides. It takes events and returns effects.

A machine has no bus, no clock and no disk, so that the same class runs over Zenoh (`Runner`), on a simulated
network in virtual time, and step by step in a debugger. The order of its effects is part of the protocol: an entry is
in the journal before its consequence is published.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from msgspec import Struct

from phototaxis.runtime.checkpoint import CheckpointMetadata
from phototaxis.wire.messages import Message

Ticket = Callable[[Message | bytes], None]
"""The function that answers one request. A machine puts it into a `Reply` and never calls it."""


class Event(NamedTuple):
    """One thing that happened."""

    topic: str
    """The topic of a message or a request, or the name of another event, such as "start" or "alive"."""
    message: Any = None
    """The decoded message of a topic, or the data of another event."""
    reply: Ticket | None = None
    """The ticket of a request, to be put into a `Reply`; None for all other events."""


START = Event("start")
"""The first event of a machine."""
TIME = Event("time")
"""The machine's deadline has come."""
STOP = Event("stop")
"""The process is asked to end in good order."""
# The other events: "alive" and "gone" carry the (role, ident) of a component whose liveliness token came or went;
# "answer" carries an `Answer`, "refused" a `Refusal`, "write_failure" an `Unwritten`.


class Answer(NamedTuple):
    """The answers to one `Ask`."""

    tag: str
    """The tag of the question."""
    messages: Sequence[Any]
    """The decoded answers; empty when nobody answered in time."""

    @property
    def first(self) -> Any:
        """The first answer, or None."""
        return self.messages[0] if self.messages else None


class Refusal(NamedTuple):
    """A message that was dropped on arrival: it could not be decoded, or a value is out of range."""

    topic: str
    why: str


class Unwritten(NamedTuple):
    """A `Begin`, `Append` or `Save` that could not be written. The journal is given up until the next `Begin`."""

    what: str
    """"journal" or "checkpoint"."""
    why: str
    """One line for people, with the file's name."""


class Publish(NamedTuple):
    """Put a message on a topic."""

    topic: str
    message: Message


class Reply(NamedTuple):
    """Answer a request, once or several times."""

    to: Ticket
    message: Message


class Ask(NamedTuple):
    """Send a query; its answers come back as one event, `Event("answer", Answer(tag, …))`."""

    tag: str
    topic: str
    request: Message | None = None
    timeout: float = 2.0
    """Seconds after which the event comes without an answer."""
    every: bool = False
    """True: collect the answers of all components. False: take the first valid answer."""
    agent: str = ""
    """Name of the one agent to ask, over a link made for it: agents on one machine are not linked. "" for everyone."""


class Listen(NamedTuple):
    """Subscribe to a topic that this role reads on demand, or unsubscribe from it."""

    topic: str
    wanted: bool


class Refuse(NamedTuple):
    """Count a dropped message, and report the first of each kind on standard error."""

    topic: str
    why: str


class Say(NamedTuple):
    """Print one line on standard error."""

    text: str


class Warn(NamedTuple):
    """Print a warning about something that does not stop the process, once for each line."""

    text: str


class Begin(NamedTuple):
    """Replace the journal by one that holds this header alone."""

    header: bytes


class Append(NamedTuple):
    """Add an entry to the journal."""

    entry: bytes


class Save(NamedTuple):
    """Write a checkpoint, whole or not at all, and then begin the journal anew with this header."""

    meta: CheckpointMetadata
    arrays: dict[str, np.ndarray]
    header: bytes
    last: bool = False
    """Whether the process ends after this save; a failed write is then the error with which it exits."""


class Record(NamedTuple):
    """Add a row to the log. All rows of a chunk share one head; a row with another head begins a new chunk."""

    head: tuple[Any, ...]
    row: tuple[Any, ...]


class Flush(NamedTuple):
    """Publish the waiting rows, although their chunk is not full."""


class Stop(NamedTuple):
    """End the loop once the effects before this one are carried out."""


class Own(Struct):
    """The base of effects that only one component has; that component's server carries them out."""


Effect = Publish | Reply | Ask | Listen | Refuse | Say | Warn | Begin | Append | Save | Record | Flush | Stop | Own


class Machine(Protocol):
    """One component's side of a protocol, as a state machine without input or output."""

    def on(self, event: Event, now: float) -> list[Effect]:
        """Take an event and return its effects, in order. `now`: seconds of a monotonic clock."""
        ...

    @property
    def deadline(self) -> float:
        """When the machine next wants `TIME` if no other event comes, on the clock of `now`; infinity for never."""
        ...
