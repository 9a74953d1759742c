"""The processes of a run: one for each component in the table of roles, and any number of agents."""

from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.options import flags
from phototaxis.runtime.roles import COMPONENTS
from phototaxis.wire.messages import Status

from phototaxis_launcher.child import Child
from phototaxis_launcher.folder import RunFolder
from phototaxis_launcher.options import UpOptions, learner_of, successor, swap_plan


class Processes:
    """The child processes of a launcher.

    Parameters
    ----------
    words : options of the first agent.
    ports : ports of the recorder, for gRPC and for its web page; if empty, there is no recorder.

    Attributes
    ----------
    children : the first process of each role.
    agents : all agents: the first, and those that take over from it.
    """

    def __init__(self, options: UpOptions, fmus: FmuOptions, words: list[str], folder: RunFolder, ports: list[int]):
        self._folder, self._bus, self._words = folder, options.bus_flags(), words
        self._lost: list[UserError] = []
        self.agents: list[Child] = []
        arguments = {
            "sim": [
                f"--run={folder.run}", f"--arena={options.arena}", f"--seed={options.seed}",
                f"--epochs={options.epochs}", f"--speed={options.speed}", f"--robots={options.robots}",
                f"--journal={folder.path / 'sim.journal'}",
            ],
            "sensors": flags(fmus),
        }  # fmt: skip
        if ports:
            output, (grpc, web) = folder.path / "recording.rrd", ports
            arguments["recorder"] = [f"--output={output}", f"--grpc-port={grpc}", f"--web-port={web}"]
        self.children = {role: self._child(role, role, own) for role, own in arguments.items()}
        self.children["agent"] = self._agent(words)
        for tick, learner in swap_plan(options.swap):
            self._agent(successor(words, ["--learner", learner]), "--take-over", f"--at={tick}")

    def _child(self, role: str, name: str, words: list[str], label: str = "") -> Child:
        arguments, may_leave = [*self._bus, *words], COMPONENTS[role].may_leave
        return Child(name, f"phototaxis_{role}", arguments, self._folder.path, label=label, may_leave=may_leave)

    def _agent(self, words: list[str], *more: str) -> Child:
        name = f"agent-{len(self.agents) + 1}" if self.agents else "agent"
        own = f"--checkpoint={self._folder.checkpoint(name)}"
        self.agents.append(self._child("agent", name, [own, *words, *more], learner_of(words)))
        return self.agents[-1]

    def another_agent(self, words: list[str]) -> Child:
        """Start one more agent, which takes over the seat as soon as it can."""
        child = self._agent(successor(self._words, words), "--take-over")
        child.start()
        return child

    def all(self) -> list[Child]:
        """Every process, the agents last."""
        return [*(child for child in self.children.values() if child not in self.agents), *self.agents]

    def start(self) -> None:
        """Start all processes except the first agent, which starts when the others are on the bus."""
        for name, role in COMPONENTS.items():
            for child in self._of(name)[1 if role.joins_last else 0 :]:
                child.start()

    def missing(self, status: Status) -> list[str]:
        """Name what the first agent still waits for: components not yet on the bus, else agents not yet queued."""
        joined = {who.split("/")[0] for who in status.alive}
        absent = {role for role in self.children if not COMPONENTS[role].joins_last} - joined
        return sorted(absent) or [agent.name for agent in self.agents[1:] if not {*agent.idents} & {*status.next}]

    def complete(self, status: Status) -> bool:
        """Whether every role is on the bus."""
        return self.children.keys() <= {who.split("/")[0] for who in status.alive}

    def stop(self) -> None:
        """End every process, in the reverse order of the start."""
        for name, role in reversed(COMPONENTS.items()):
            for child in self._of(name):
                child.stop(role.ends_within_s)

    def _of(self, role: str) -> list[Child]:
        return self.agents if role == "agent" else [self.children[role]] if role in self.children else []

    def go_on_without_recorder(self, error: UserError) -> None:
        """Drop the recorder, which has ended with `error`, and keep the error for the result."""
        del self.children["recorder"]
        self._lost.append(error)

    def faults(self) -> list[UserError]:
        """Return the errors of processes that ended too early or could not save everything."""
        return [*self._lost, *(Unavailable(fault) for child in self.all() if (fault := child.fault()))]
