"""`phototaxis up`: the processes of a run, brought up, watched and ended together."""

import json
import re
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta
from phototaxis.bus import Bus, Event
from phototaxis.checkpoint import load
from phototaxis.errors import INTERRUPTED, ComponentFailed, Unavailable, UserError, warn
from phototaxis.fmu import FmuOptions
from phototaxis.messages import MAX_ROBOTS, Control, Count, Launch, LaunchReply, Seed, Status
from phototaxis.options import Parser, add_options, convert, flags, peek
from phototaxis.ports import find_ports
from phototaxis.session import BusOptions, open_session
from phototaxis.viewer import viewer_url

from phototaxis_launcher.folder import RunFolder
from phototaxis_launcher.places import places, program
from phototaxis_launcher.processes import Child
from phototaxis_launcher.progress import Progress
from phototaxis_launcher.show import Show

PORT = Annotated[int, Meta(ge=-1, le=65535)]
PATIENCE = {"recorder": 60.0, "agent": 15.0, "sensors": 5.0, "sim": 5.0}
"""Seconds that a component gets to end; also the order in which they are ended."""
ALONE = ("--checkpoint", "--policy", "--standby", "--take-over", "--at", "--worlds", "--ident")
"""Options of an agent that is started alone; the launcher gives its own agents theirs."""
SWAPS = re.compile(r"(?P<tick>[0-9]+):(?P<learner>[^:,\s]+)")
ANSWERED_WITHIN = 5.0
"""Seconds that the simulation gets to pause, and the driver to answer the last tick of a run that is stopped."""
SILENT = 5.0
"""Seconds after which a driver that is there but does not answer is named."""
MOSTLY = 0.95
"""Share of ticks without a command in time from which on a run in real time has failed."""
STARTING = 60.0
"""Seconds within which all components must be on the bus."""


class UpOptions(BusOptions, kw_only=True):
    """Options of a run. Every option of `phototaxis agent` is understood too and passed on to it."""

    arena: str = "paper"
    """name of a shipped arena, or a TOML file"""
    seed: Seed = 0
    """decides everything: placements, noise, the learner and its exploration"""
    epochs: Count = 3000
    """learning steps; 0: run until stopped"""
    speed: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """simulated seconds per second; 0: lockstep, as fast as it goes"""
    robots: Annotated[int, Meta(ge=1, le=MAX_ROBOTS)] = 1
    """so many robots at once, each alone in its arena; one learner drives them all, the first is recorded"""
    swap: str = ""
    """TICK:LEARNER,…: at these ticks fresh agents take over; they inherit from one of their kind, and learn in the
    shadow of another"""
    out: str = "runs"
    """folder for the run's own folder: recording, checkpoint, logs"""
    no_recorder: bool = False
    """run without a recording and a viewer"""
    grpc_port: PORT = 9876
    """port of the recorder's Rerun server; 0: any free one"""
    web_port: PORT = 9090
    """port of the web viewer; 0: any free one; -1: no web viewer"""
    json: bool = False
    """print the result as one JSON object, last on standard output"""


class Run:
    """One run of the system."""

    def __init__(self, options: UpOptions, fmus: FmuOptions, agent_words: list[str]):
        self._options, self._words, self._fmus = options, agent_words, fmus
        self._complained = False
        self._drove: set[str] = set()
        swaps = swap_plan(options.swap)
        wanted = {"--grpc-port": options.grpc_port, "--web-port": options.web_port}
        ports = [] if options.no_recorder else find_ports("127.0.0.1", wanted)
        self._place = RunFolder(Path(options.out))
        self.folder = self._place.path
        self.name = self.folder.name
        self._begun = False
        self._lost: UserError | None = None
        """How the recorder ended before the run did."""
        self.interrupted = False
        """Whether Ctrl-C ended it."""
        self.recording = self.folder / "recording.rrd"
        self.url = ""
        self._alive: list[str] = []
        self._announced = self.name
        bus = self._bus = _bus_flags(options)
        common = [f"--run={self.name}", f"--arena={options.arena}", f"--seed={options.seed}"]
        self.agents: list[Child] = []
        self._pending: list[tuple[Child, Event]] = []
        self.children = {
            "sim": self._child(
                "sim", *bus, *common, f"--epochs={options.epochs}", f"--speed={options.speed}",
                f"--robots={options.robots}",
                f"--journal={self.folder / 'sim.journal'}",
            ),
            "sensors": self._child("sensors", *bus, *flags(fmus)),
            "agent": self._agent(agent_words),
        }  # fmt: skip
        for tick, learner in swaps:
            self._agent(successor(agent_words, ["--learner", learner]), "--take-over", f"--at={tick}")
        if ports:
            grpc, web = ports
            self.children["recorder"] = self._child(
                "recorder", *bus, f"--output={self.recording}", f"--grpc-port={grpc}", f"--web-port={web}"
            )
            if web > 0:
                self.url = viewer_url(web, grpc)

    def _child(self, role: str, *arguments: str) -> Child:
        return Child(role, f"phototaxis_{role}", list(arguments), self.folder, may_leave=role == "sim")

    def _agent(self, words: list[str], *more: str) -> Child:
        """One more agent, with a checkpoint of its own."""
        name = f"agent-{len(self.agents) + 1}" if self.agents else "agent"
        arguments = [*self._bus, f"--checkpoint={self._checkpoint(name)}", *words, *more]
        child = Child(name, "phototaxis_agent", arguments, self.folder, label=_learner(words), may_leave=True)
        self.agents.append(child)
        return child

    def _checkpoint(self, name: str) -> Path:
        return self.folder / f"{name.replace('agent', 'checkpoint')}.npz"

    def go(self, progress: Progress, show: Show | None = None) -> Status:
        """Start, watch until finished or stopped, end; the last status.

        The agent is started when everyone else is on the bus, so that the recording has every tick. A run that is
        stopped is paused first: status, checkpoints and recording then end with the same tick.
        """
        show = show or Show()
        status = Status(run=self.name, phase="waiting")
        with (
            self._folder_of_a_run(),
            open_session("launcher", self._options) as session,
            Bus(session, self._options.name, "launcher", f"up-{self.name}") as bus,
        ):

            def end(number: int, _: object) -> None:
                self.interrupted = self.interrupted or number == signal.SIGINT
                bus.stop()

            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, end)
            try:
                for role, child in self.children.items():
                    if role != "agent":
                        child.start()
                for agent in self.agents[1:]:
                    agent.start()
                deadline = time.monotonic() + STARTING
                while not self._complete(status) and not self.children["sim"].left:
                    event = bus.receive(timeout=show.wait())
                    show.beat(bus)
                    self._watch(progress)
                    if event is not None and event.topic == "stop":
                        status = _paused(bus, status)
                        break
                    if event is not None and event.topic == "launch":
                        self._launch(event, progress)
                    if event is not None and event.topic == "status":
                        status = event.message
                        self._begun = self._begun or status.tick > 0
                        progress.show(status)
                        self._report(status, progress)
                        self._complain(status, progress)
                        self._confirm(status)
                        self._miss(status, progress)
                        show.follow(status, bus, progress)
                    if self.children["agent"].process is None:
                        self._start_agent(status, deadline, progress)
                else:
                    status = _last(bus, status) if self.children["sim"].left else status
                    progress.close()
                    if status.phase == "finished" and show.finished(self.result(status)):
                        self._linger(bus, progress)
            finally:
                try:
                    progress.close()
                finally:
                    self.stop()
        return status

    def _linger(self, bus: Bus, progress: Progress) -> None:
        """Keep everything up, for those who watch, until a signal or until the simulation is stopped."""
        where = self.url or f"{program()} view"
        print(f"Still to be seen: {where}\nDrag the time line to any moment of the run. Ctrl-C ends.", file=sys.stderr)
        while not self.children["sim"].left:
            event = bus.receive(timeout=0.1)
            if event is not None and event.topic == "stop":
                return
            self._watch(progress)

    @contextmanager
    def _folder_of_a_run(self) -> Iterator[None]:
        """A run that the user's input or a missing peer kept from beginning leaves no folder."""
        try:
            yield
        except UserError as error:
            if not self._begun and not isinstance(error, ComponentFailed):
                self._place.remove()
            raise

    def _complete(self, status: Status) -> bool:
        """Finished, and all are there to take part in the ending (one may just have been restarted)."""
        return status.phase == "finished" and self.children.keys() <= {who.split("/")[0] for who in status.alive}

    def _watch(self, progress: Progress) -> None:
        for child in self._all():
            for line in child.warnings():
                warn(line)
            try:
                if child.watch():
                    progress.say(f"{child.name} ended and was restarted; see {self.folder}")
            except UserError as error:
                if child.name == "recorder" and self.children["agent"].process is not None:
                    self._lost = error
                    del self.children["recorder"]
                    warn(f"{error}; the run goes on without it")
                    continue
                if not self._answer(child, LaunchReply(reason=str(error))):
                    raise
                progress.say(str(error))
                self.agents.remove(child)

    def _all(self) -> list[Child]:
        return [*(child for child in self.children.values() if child not in self.agents), *self.agents]

    def _launch(self, event: Event, progress: Progress) -> None:
        """Start an agent that takes over; the answer is given when it drives, or cannot."""
        request: Launch | None = event.message
        if request is None or event.reply is None:
            return
        child = self._agent(successor(self._words, request.words), "--take-over")
        child.start()
        self._pending.append((child, event))
        progress.say(f"asked to swap: {child.name} is started")

    def _confirm(self, status: Status) -> None:
        """Tell those who asked for a swap that it has happened."""
        for child, _ in list(self._pending):
            for seating in status.drivers:
                if seating.driver in child.idents:
                    self._answer(child, LaunchReply(agent=seating.driver, tick=seating.tick))

    def _miss(self, status: Status, progress: Progress) -> None:
        """Bring back an agent that ended without a word, though nobody has taken the seat over from it."""
        self._drove |= {one.driver for one in status.drivers}
        last = status.drivers[-1].driver if status.drivers else ""
        for agent in self.agents:
            drove = self._drove & {*agent.idents}
            if agent.left and status.phase != "finished" and not status.driver and (last in drove or not drove):
                agent.bring_back()
                progress.say(f"{agent.name} ended before its time and was restarted; see {self.folder}")

    def _answer(self, child: Child, reply: LaunchReply) -> bool:
        """Answer who asked for this agent; whether somebody had."""
        asked = [event for one, event in self._pending if one is child]
        for event in asked:
            if event.reply is not None:
                event.reply(reply)
        self._pending = [(one, event) for one, event in self._pending if one is not child]
        return bool(asked)

    def _report(self, status: Status, progress: Progress) -> None:
        """Say what the status warns of, when a new run begins by request, and who is alive when that changes."""
        for line in status.warnings:
            warn(line)
        if status.run != self._announced:
            self._announced = status.run
            progress.say(f"a new run begins, as was asked for: {status.run}")
        alive = [who.split("/")[1] for who in status.alive if not who.startswith("observer/")]
        if alive != self._alive:
            self._alive = alive
            progress.say(f"alive: {', '.join(alive)}")

    def _complain(self, status: Status, progress: Progress) -> None:
        """Say which part is too slow, or silent, when that begins."""
        complaint = ""
        if status.too_slow:
            complaint = f"at {status.speed:g} × real time {status.too_slow}; then the motors stop: lower the speed"
        elif status.phase == "waiting" and status.driver and status.waited > SILENT:
            complaint = f"{status.driver} is there, but does not answer tick {status.tick}; see {self.folder}"
        if complaint and not self._complained:
            fmus = [fmu for fmu in (self._fmus.light_fmu, self._fmus.sonar_fmu) if fmu]
            progress.say(complaint + (f" (the sensors use {' and '.join(fmus)})" if fmus else ""))
        self._complained = bool(complaint)

    def _start_agent(self, status: Status, deadline: float, progress: Progress) -> None:
        present = {who.split("/")[0] for who in status.alive}
        missing = self.children.keys() - present - {"agent"}
        waiting = [agent.name for agent in self.agents[1:] if not {*agent.idents} & {*status.next}]
        if not missing and not waiting:
            self.children["agent"].start()
            if self.url:
                progress.say(f"watch at {self.url}")
        elif time.monotonic() > deadline:
            who = ", ".join(sorted(missing) or waiting)
            raise ComponentFailed(f"{who} did not come up within {STARTING:g} s; see {self.folder}")

    def stop(self) -> None:
        """End every child; the recorder first, while those it still asks are alive."""
        for role, patience in PATIENCE.items():
            for child in self.agents if role == "agent" else [self.children[role]] if role in self.children else []:
                child.stop(patience)

    def checkpoint(self, status: Status) -> Path | None:
        """That of the agent that drove last; None when it is not one of ours, or could not save its last state."""
        last = status.drivers[-1].driver if status.drivers else ""
        ours = [self._checkpoint(agent.name) for agent in self.agents if last in agent.idents and not agent.fault()]
        return next((file for file in ours if file.exists()), None)

    def result(self, status: Status) -> dict[str, Any]:
        """What the run came to; the learner is the one that drove last, if that is one of ours."""
        checkpoint = self.checkpoint(status)
        meta = load(checkpoint)[0] if checkpoint else None
        names = {ident: agent for agent in self.agents for ident in agent.idents}
        recordings = sorted(self.folder.glob("recording*.rrd"), key=lambda path: path.stat().st_mtime)
        return {
            "run": status.run,
            "arena": self._options.arena,
            "seed": self._options.seed if status.run == self.name else None,
            "learner": meta.learner if meta else None,
            "drivers": [
                {
                    "driver": one.driver,
                    "learner": names[one.driver].label if one.driver in names else None,
                    "checkpoint": str(self._checkpoint(names[one.driver].name)) if one.driver in names else None,
                    "from_tick": one.tick,
                    "how": one.how,
                }
                for one in status.drivers
            ],
            "finished": status.phase == "finished",
            "epochs": status.epoch,
            "episodes": status.episodes,
            "reached": status.reached,
            "recent_success": status.recent,
            "ticks": status.tick,
            "ticks_per_second": round(status.mean_rate, 1),
            "state_hash": status.hash,
            "learner_hash": meta.learner_hash if meta else None,
            "recording": str(recordings[-1]) if recordings else None,
            "checkpoint": str(checkpoint) if checkpoint else None,
            "restarts": {child.name: child.restarts for child in self._all() if child.restarts},
            "late_ticks": status.late,
            "late_sensors": status.late_sensors,
            "refused": status.refused,
            "warnings": [*status.warnings, *map(str, self._faults())],
        }

    def _faults(self) -> list[UserError]:
        """What ended before its time, or could not be saved to its end."""
        unsaved = [Unavailable(fault) for child in self._all() if (fault := child.fault())]
        return [*([self._lost] if self._lost else []), *unsaved]

    def end(self, status: Status) -> int:
        """The exit code of a run whose result is told.

        Raises
        ------
        UserError
            for what did not keep the run from its end: a recording or a checkpoint that could not be written, or a
            robot that stood still since no command came in time.
        """
        for fault in self._faults():
            raise fault
        if self.interrupted:
            return INTERRUPTED
        if status.late > MOSTLY * status.tick:
            part = "sensors" if 2 * status.late_sensors > status.late else "agent"
            line = f"only {status.tick - status.late} of {status.tick} ticks had a command in time"
            raise ComponentFailed(
                f"{line}, the robot stood still: the {part} cannot keep up; lower --speed (0: as fast as it goes)"
            )
        return 0


def _paused(bus: Bus, status: Status) -> Status:
    """The status of a run that is paused for its end, when the driver has answered its last tick."""
    reply, deadline = bus.control(Control(verb="pause"), ANSWERED_WITHIN), time.monotonic() + ANSWERED_WITHIN
    while reply is not None:
        status = reply.status  # asked for: those in the inbox may be older than the pause
        if status.phase != "paused" or not status.waiting_for or time.monotonic() > deadline:
            break
        bus.receive(timeout=0.05)
        reply = bus.control(Control(verb="status"), ANSWERED_WITHIN)
    return status


def _last(bus: Bus, status: Status) -> Status:
    """The last status of a simulation that has ended by request."""
    while (event := bus.receive(timeout=0.2)) is not None:
        status = event.message if event.topic == "status" else status
    return status


def successor(first: list[str], words: list[str]) -> list[str]:
    """Words for a new agent: what the first one was given comes first, as far as it is not another learner's."""
    if _learner(words) == _learner(first):
        return [*first, *words]
    percept = peek(first, "--percept", "")
    return [*([f"--percept={percept}"] if percept else []), *words]


def swap_plan(text: str) -> list[tuple[int, str]]:
    """The ticks and learners of TICK:LEARNER,…; UserError when it is something else."""
    found = [SWAPS.fullmatch(part) for part in text.split(",")] if text else []
    plan = [(int(one["tick"]), one["learner"]) for one in found if one]
    if len(plan) < len(found) or sorted({tick for tick, _ in plan}) != [tick for tick, _ in plan]:
        raise UserError(f"--swap {text}: expected TICK:LEARNER with growing ticks, as in 1000:qtable,2000:dqn")
    return plan


def for_ours(words: list[str]) -> list[str]:
    """Words for an agent that the launcher starts; UserError when one is for an agent that is started alone."""
    for word in words:
        if (option := word.split("=")[0]) in ALONE:
            raise UserError(f"{option} is for an agent that is started alone, beside a run: phototaxis agent {option}")
    return words


def _learner(words: Sequence[str]) -> str:
    return peek(words, "--learner", "qtable")


def parse(argv: Sequence[str], prog: str = "phototaxis up") -> tuple[UpOptions, FmuOptions, list[str]]:
    """Our own options, those of the sensors, and the words for the agent."""
    parser = Parser(
        prog=prog,
        description="Start simulation, sensors, agent and recorder, and watch over them.",
        epilog="Options of `phototaxis agent` (see its --help) are passed on to the agent.",
    )
    add_options(parser, UpOptions)
    add_options(parser.add_argument_group("sensor models"), FmuOptions)
    own, words = parser.parse_known_args(argv)
    options = convert(UpOptions, vars(own))
    if options.listen:
        raise UserError(f"--listen is for single components; {prog} links its own, or uses a router with --connect")
    for learner in {_learner(words), *(learner for _, learner in swap_plan(options.swap))}:
        import_module("phototaxis_agent.__main__").read(successor(words, ["--learner", learner]), parser.option_strings)
    return options, convert(FmuOptions, vars(own)), for_ours(words)


def main(argv: Sequence[str]) -> int:
    options, fmus, words = parse(argv)
    run = Run(options, fmus, words)
    status = run.go(Progress(options.epochs))
    result = run.result(status)
    if options.json:
        print(json.dumps(result), flush=True)
    else:
        print(*summary(result), sep="\n", file=sys.stderr)
    return run.end(status)


def summary(result: dict[str, Any]) -> list[str]:
    """The result in lines for a person."""
    line = (
        f"{result['epochs']} epochs, {result['episodes']} episodes, {result['reached']} of them reached the light; "
        f"{result['ticks_per_second']} ticks/s"
    )
    late = [f"late        {result['late_ticks']} ticks without a command in time"] if result["late_ticks"] else []
    return [line, *late, *places(result)]


def _bus_flags(options: UpOptions) -> list[str]:
    only = BusOptions(**{field: getattr(options, field) for field in BusOptions.__struct_fields__})
    return flags(only)
