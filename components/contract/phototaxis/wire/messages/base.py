"""What all messages share: the base class, the types of their fields, and their limits."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

SCHEMA = 1
"""Version of the message schema; both sides of a bus must have the same."""

MAX_ROBOTS = 4096
"""Most robots that a world may have."""

Motor = Annotated[float, Meta(ge=-1, le=1)]
"""A wheel's command, as a share of full speed; negative is backwards."""
Name = Annotated[str, Meta(max_length=64, pattern=r"^[A-Za-z0-9_.-]*$")]
"""The name of a run or a component; "" where a field allows none."""
Count = Annotated[int, Meta(ge=0, le=2**53)]
"""A whole number within the range that JSON readers of all languages keep exactly."""
Seed = Count
"""A seed of random numbers."""

End = Literal["", "terminated", "truncated", "reset"]
"""How an episode ends: "" while it goes on, at the light, after its full number of steps, or by request."""
ENDS: tuple[End, ...] = ("", "terminated", "truncated", "reset")
"""The ends by the numbers that `BatchCommand` has for them."""


class Message(Struct, forbid_unknown_fields=True, kw_only=True):
    """The base of all messages: it carries the version of the schema."""

    schema: int = SCHEMA
    """Version of the message schema; a receiver refuses every other version than its own."""
