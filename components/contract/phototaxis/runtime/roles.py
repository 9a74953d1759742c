"""The table of roles: for each kind of component its topics, its queries, and how its process starts and ends.

Subscriptions, links, rights, subcommands, the launcher's processes, health checks and the services of
`deploy/compose.yaml` derive from it.
"""

from typing import NamedTuple


class Role(NamedTuple):
    """One kind of component: its topics, its links, and how its process starts and ends."""

    reads: tuple[str, ...]
    """Topics that it subscribes to."""
    dials: tuple[str, ...] = ()
    """Roles that it connects to when no router is used."""
    listens: bool = True
    """Whether others may connect to it when no router is used."""
    asks: tuple[str, ...] = ()
    """Topics that it queries, beside the logs that it reads."""
    on_demand: tuple[str, ...] = ()
    """Topics that it subscribes to only while it needs them."""
    about: str = ""
    """What a process of this role runs, for the help; "" for a role without a process of its own."""
    waits_for: str = ""
    """The components that it needs before it can work, in words."""
    joins_last: bool = False
    """Whether the launcher starts it only when all others are on the bus."""
    may_leave: bool = False
    """Whether its process may end without an error while the run goes on."""
    ends_within_s: float = 0.0
    """Seconds that it has to shut down cleanly."""


ROLES = {
    "sim": Role(
        reads=("command", "batch/command", "recording"),
        on_demand=("readings", "batch/readings"),
        about="the simulation alone", waits_for="sensors and an agent", may_leave=True, ends_within_s=5.0,
    ),
    "sensors": Role(
        reads=("state", "batch/state"), dials=("sim",), asks=("world", "log/sim"),
        about="the sensors alone", waits_for="a simulation", ends_within_s=5.0,
    ),
    "agent": Role(
        reads=("readings", "batch/readings"),
        dials=("sim", "sensors", "recorder"), asks=("world", "control", "checkpoint"),
        about="an agent alone", waits_for="a simulation and its sensors",
        joins_last=True, may_leave=True, ends_within_s=15.0,
    ),
    "recorder": Role(
        reads=("log/sim", "log/sensors", "log/agent"), dials=("sim", "sensors"), asks=("world",),
        about="the recorder alone", waits_for="a simulation, its sensors and an agent", ends_within_s=60.0,
    ),
    "launcher": Role(reads=("status",), dials=("sim",), asks=("control",)),
    "observer": Role(reads=("status",), dials=("sim", "launcher"), listens=False, asks=("world", "control", "launch")),
}  # fmt: skip
"""The roles in the order in which they start. They end in the opposite order, so that the recorder can still query
the others. The simulation listens and the others connect to it; agents listen only for their successors.
"""

COMPONENTS = {name: role for name, role in ROLES.items() if role.about}
"""The roles that are processes of their own: each has a folder, an extra, a subcommand and a service of its name."""
