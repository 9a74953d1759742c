"""What a machine is: a class that decides, and does nothing else. Events go in, effects come out.

A machine has no bus, no clock and no disk, so that the same class runs over Zenoh (`Runner`), on a simulated
network in virtual time, and step by step in a debugger. What it wants to happen it returns as effects, and their order
is part of the protocol: an entry is in the journal before anybody hears of what it led to.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from msgspec import Struct

from phototaxis.runtime.checkpoint import CheckpointMetadata
from phototaxis.wire.messages import Message

Ticket = Callable[[Message | bytes], None]
"""Stands for one request; a machine hands it back with its answer and never calls it."""


class Event(NamedTuple):
    """One thing that happened."""

    topic: str
    """The topic of a message or a request, or one of the names below."""
    message: Any = None
    """The decoded message, or what the event of that name carries."""
    reply: Ticket | None = None
    """For a request: what a `Reply` names."""


START = Event("start")
"""The first event of a machine."""
TIME = Event("time")
"""The machine's deadline has come."""
STOP = Event("stop")
"""The process is asked to end in good order."""
# The other events: "alive" and "gone" carry the (role, ident) of a component whose liveliness token came or went;
# "answer" carries an `Answer`, "refused" a `Refusal`, "write_failure" an `Unwritten`.


class Answer(NamedTuple):
    """What became of an `Ask`."""

    tag: str
    """The tag of the question."""
    messages: Sequence[Any]
    """The decoded answers; empty when nobody answered in time."""

    @property
    def first(self) -> Any:
        """The first answer, or None."""
        return self.messages[0] if self.messages else None


class Refusal(NamedTuple):
    """A message that was dropped at the door: it could not be decoded, or is out of range."""

    topic: str
    why: str


class Unwritten(NamedTuple):
    """A `Begin`, `Append` or `Save` that the disk did not take. The journal is given up until it is begun anew."""

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
    """True: gather the answers of every component that answers. False: take the first valid answer."""
    agent: str = ""
    """Ask the agent with this name: agents of one machine are not linked to each other."""


class Listen(NamedTuple):
    """Receive a topic that this role reads at times, or receive it no more."""

    topic: str
    wanted: bool


class Refuse(NamedTuple):
    """Say that a message is dropped, the first time of each kind."""

    topic: str
    why: str


class Say(NamedTuple):
    """Tell people one line, on standard error."""

    text: str


class Warn(NamedTuple):
    """Warn people of what does not stop the process, once for each line."""

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
    """The process ends after it: a checkpoint that cannot be written is then the process's error."""


class Record(NamedTuple):
    """Add a row to the log. All rows of a chunk share one head; a row with another head begins a new chunk."""

    head: tuple[Any, ...]
    row: tuple[Any, ...]


class Flush(NamedTuple):
    """Publish the rows that wait, although their chunk is not full."""


class Stop(NamedTuple):
    """End the loop once the effects before this one are carried out."""


class Own(Struct):
    """The base of effects that one component's machine has for itself, and its server carries out."""


Effect = Publish | Reply | Ask | Listen | Refuse | Say | Warn | Begin | Append | Save | Record | Flush | Stop | Own


class Machine(Protocol):
    """One component's side of the protocol."""

    def on(self, event: Event, now: float) -> list[Effect]:
        """What follows from an event. `now`: seconds of a monotonic clock."""
        ...

    @property
    def deadline(self) -> float:
        """When `TIME` is wanted although nothing else happens, on the clock of `now`; infinity for never."""
        ...
