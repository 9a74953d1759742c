"""Messages by which one agent succeeds another: a request for its checkpoint, and a request to start one."""

from typing import Annotated

from msgspec import Meta

from phototaxis.wire.messages.base import Count, Message, Name


class CheckpointRequest(Message, kw_only=True):
    """A successor's request to an agent for all that it needs to continue bit for bit."""

    agent: Name
    """Name of the agent that is asked; every other agent keeps silent."""
    probe: bool = False
    """Whether the agent only says if its checkpoint would fit, without sending it."""
    learner: str
    """Name of the successor's learner; an agent with another learner refuses."""
    percept: str
    """Name of the successor's percept; an agent with another percept refuses."""


class CheckpointReply(Message, kw_only=True):
    """An agent's reply to its successor."""

    reason: str = ""
    """Why the checkpoint does not fit, in one line; "" when it fits."""
    data: bytes = b""
    """The checkpoint, a NumPy .npz file without pickles; empty after a refusal or a probe."""


class LaunchRequest(Message, kw_only=True):
    """A request to the launcher: start an agent that takes the seat over."""

    words: Annotated[list[Annotated[str, Meta(max_length=1000)]], Meta(max_length=100)]
    """Options of `phototaxis agent`, at most 100 words: the learner and its hyperparameters."""


class LaunchReply(Message, kw_only=True):
    """The launcher's reply, given when the new agent drives or has failed."""

    reason: str = ""
    """Why no new agent drives, in one line; "" when it drives."""
    agent: Name = ""
    """Name of the new agent; "" after a failure."""
    tick: Count = 0
    """Number of the first tick that the new agent answers; 0 after a failure."""
