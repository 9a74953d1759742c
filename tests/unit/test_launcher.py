"""What the launcher says and decides, without processes."""

import os
import socket
import sys
from pathlib import Path
from typing import Any

import pytest
from phototaxis.runtime.errors import Unavailable, UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.ports import find_ports, free_ports
from phototaxis.wire.messages import Control, Phase, Status, World
from phototaxis_agent.setup import make_setup
from phototaxis_launcher import demo, swap
from phototaxis_launcher.child import Child
from phototaxis_launcher.cli import extra_with
from phototaxis_launcher.folder import RunFolder
from phototaxis_launcher.news import News
from phototaxis_launcher.options import UpOptions, parse
from phototaxis_launcher.paths import run_paths
from phototaxis_launcher.processes import Processes
from phototaxis_launcher.progress import success
from phototaxis_recorder.recordings import table
from phototaxis_recorder.summary import RecordingFile, Summary
from phototaxis_sim import arenas


class Wire:
    """A bus that notes what is asked of the simulation."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def control(self, request: Control) -> None:
        self.asked.append(request.verb)


class Said(list[str]):
    def say(self, text: str) -> None:
        self.append(text)

    def show(self, status: Status) -> None:
        """A bar is no news."""


def test_a_watched_demo_begins_and_ends_slowly(monkeypatch: pytest.MonkeyPatch):
    now = [100.0]
    monkeypatch.setattr(demo.time, "monotonic", lambda: now[0])
    story = demo.Story(UpOptions(epochs=3000), FmuOptions(), stays=True, paced=True)
    wire: Any = Wire()
    said: Any = Said()

    def at(epoch: int, phase: Phase = "paused", driver: str = "qtable-1", waiting_for: str = "") -> list[str]:
        wire.asked.clear()
        status = Status(run="r", phase=phase, waiting_for=waiting_for, epoch=epoch, epochs=3000, driver=driver)
        story.follow(status, wire, said)
        return [*wire.asked]

    def due() -> bool:
        wire.asked.clear()
        story.beat(wire)
        return wire.asked == ["step"]

    assert at(0, "waiting", driver="") == ["pause"], "before anybody drives"
    assert at(0, waiting_for="the command of qtable-1") == []
    assert not due(), "the first tick is not answered yet"
    assert at(0) == []
    assert due()
    assert 0 < story.wait() <= 0.1
    assert not due(), "one step at a time"
    assert at(149) == []
    assert at(150) == ["resume"]
    assert not due()
    assert at(400, "running") == []
    now[0] += 0.2
    assert at(1500, "running") == []
    now[0] += 0.2
    assert at(2600, "running") == [], "the pause is due before the next status"
    assert not due()
    assert story.wait() == pytest.approx(0.2 * 100 / 1100)
    now[0] += story.wait()
    assert not due()
    assert wire.asked == ["pause", "step"]
    assert story.wait() == pytest.approx(0.1)
    assert [line[:2] for line in said[1:]] == ["1.", "2.", "3."]


def test_a_demo_that_nobody_watches_is_left_alone():
    story = demo.Story(UpOptions(epochs=3000), FmuOptions(), stays=False, paced=False)
    wire: Any = Wire()
    said: Any = Said()
    for epoch in range(0, 3001, 100):
        story.follow(Status(run="r", phase="running", epoch=epoch, epochs=3000, driver="q"), wire, said)
        story.beat(wire)
    assert not wire.asked
    assert not said


@pytest.mark.parametrize(
    ("learner", "given", "options", "fmus", "is_it"),
    [
        ("qtable", {}, {}, {}, True),
        ("mirror", {}, {}, {}, False),
        ("qtable", {"percept": "rich"}, {}, {}, False),
        ("qtable", {"reward": "potential"}, {}, {}, False),
        ("qtable", {}, {"epochs": 500}, {}, False),
        ("qtable", {}, {"arena": "doorway"}, {}, False),
        ("qtable", {}, {"swap": "10:qtable"}, {}, False),
        ("qtable", {}, {}, {"light_fmu": "lag.fmu"}, False),
    ],
)
def test_the_papers_number_is_told_of_the_papers_system_alone(learner, given, options, fmus, is_it):
    arena = arenas.load(options.get("arena", "paper"))
    meta = make_setup(learner, **given).agent(World(run="r", arena=arena, seed=0, epochs=3000)).checkpoint()[0]
    assert demo.is_the_papers(meta, UpOptions(**options), FmuOptions(**fmus)) is is_it


def test_success_is_told_of_episodes_that_have_ended():
    def told(episodes: int, reached: int, recent: float) -> str:
        return success(Status(run="r", phase="running", episodes=episodes, reached=reached, recent=recent))

    assert told(0, 0, 0.0) == "no episode has ended yet"
    assert told(1, 0, 0.0) == "the first episode did not reach the light"
    assert told(4, 3, 0.75) == "75% of the last 4 episodes reached the light"
    assert told(90, 50, 0.9) == "90% of the last 50 episodes reached the light"


@pytest.mark.parametrize(
    ("episodes", "words"), [(0, "no episode has ended"), (7, "3 of 7, last 7: 40%"), (91, "3 of 91, last 50: 40%")]
)
def test_a_recording_tells_success_of_episodes_that_have_ended(episodes, words):
    summary = Summary("r", "paper", episodes=episodes, reached=min(3, episodes), recent=0.4)
    assert words in table([RecordingFile(Path("r.rrd"), 1, 0.0, summary)])[1]


def test_the_end_says_how_to_look_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = str(tmp_path / "my runs" / "recording.rrd")
    lines = run_paths({"recording": file, "checkpoint": None, "drivers": [{"driver": "stranger-1"}]})
    assert lines[0].endswith(file)
    assert lines[1].endswith("phototaxis view 'my runs/recording.rrd'")
    assert lines[2] == "checkpoint  none: stranger-1 drove last, and saved none here"
    assert not any("http" in line for line in lines), "the address is dead by then"


def test_a_busy_port_says_who_holds_it(monkeypatch):
    (port,) = free_ports(1)
    with pytest.raises(Unavailable, match=rf"port {port} .*another option names it too\); choose another with --web"):
        find_ports("127.0.0.1", {"--grpc-port": port, "--web-port": port})
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port, own = taken.getsockname()[1], os.getpid()
        monkeypatch.setattr(os, "getpid", lambda: -1)
        with pytest.raises(Unavailable, match=rf"process {own} listens there: \S*py"):
            find_ports("127.0.0.1", {"--web-port": port})
        monkeypatch.setitem(sys.modules, "psutil", None)
        with pytest.raises(Unavailable, match="Address already in use"):
            find_ports("127.0.0.1", {"--web-port": port})


def test_a_missing_package_names_its_extra():
    assert extra_with("torch", "agent") == "agent"
    assert extra_with("fmpy", "fmu") == "fmu"
    assert extra_with("no_such_package", "lab") == "lab"


@pytest.mark.parametrize("words", [["--checkpoint=c.npz"], ["--policy", "p.zip"], ["--take-over"], ["--worlds", "a,b"]])
def test_the_launchers_own_agents_are_not_those_that_are_started_alone(words):
    with pytest.raises(UserError, match=f"{words[0].split('=')[0]} is for an agent that is started alone"):
        parse(words)


def test_a_swap_says_what_delays_it():
    assert swap.what_delays(Status(run="r", phase="running")) == ""
    assert "phototaxis control resume" in swap.what_delays(Status(run="r", phase="paused"))
    with pytest.raises(Unavailable, match="the run r is finished"):
        swap.what_delays(Status(run="r", phase="finished"))


@pytest.fixture
def processes(tmp_path: Path) -> Processes:
    options = UpOptions(out=str(tmp_path), swap="100:mirror")
    return Processes(options, FmuOptions(), ["--percept=rich"], RunFolder(tmp_path), [1, 2])


def test_processes_start_and_end_as_the_table_of_roles_says(processes: Processes, monkeypatch: pytest.MonkeyPatch):
    told = []
    monkeypatch.setattr(Child, "start", lambda child: told.append(child.name))
    monkeypatch.setattr(Child, "stop", lambda child, patience: told.append((child.name, patience)))
    processes.start()
    assert told == ["sim", "sensors", "agent-2", "recorder"], "the first agent joins when these are on the bus"
    told.clear()
    processes.another_agent(["--learner=qtable"])
    processes.stop()
    ends = [("recorder", 60), ("agent", 15), ("agent-2", 15), ("agent-3", 15), ("sensors", 5), ("sim", 5)]
    assert told == ["agent-3", *ends]


def test_the_first_agent_waits_for_all_others(processes: Processes):
    first, second = processes.agents
    second.idents.append("mirror-1")
    there = ["sim/s", "sensors/s", "agent/mirror-1", "observer/o"]
    assert processes.missing(Status(run="r", phase="waiting", alive=there, next=["mirror-1"])) == ["recorder"]
    there.append("recorder/r")
    assert processes.missing(Status(run="r", phase="waiting", alive=there)) == ["agent-2"]
    assert processes.missing(Status(run="r", phase="waiting", alive=there, next=["mirror-1"])) == []
    processes.go_on_without_recorder(Unavailable("recorder: the disk is full"))
    assert processes.complete(Status(run="r", phase="running", alive=there[:3]))
    assert [str(fault) for fault in processes.faults()] == ["recorder: the disk is full"]
    assert first.idents == []


def test_a_slow_or_silent_part_is_named_once(tmp_path: Path):
    said: Any = Said()
    news = News(said, RunFolder(tmp_path), FmuOptions(light_fmu="lag.fmu"))
    silent = Status(run="r", phase="waiting", driver="q-1", waited=6.0, tick=3)
    for status in (silent, silent, Status(run="r", phase="running", driver="q-1"), silent):
        news.follow(status)
    complaints = [line for line in said if "does not answer tick 3" in line]
    assert len(complaints) == 2, "again, when it begins again"
    assert complaints[0].endswith("(the sensors use lag.fmu)")
