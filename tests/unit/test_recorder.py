"""What the live view is made of: light, colours, policy; and which recordings are removed."""

import shutil
from pathlib import Path

import msgspec
import numpy as np
import pytest
import rerun as rr
from disks import no_file_larger_than
from phototaxis.geometry.arena import Arena, Light, Wall
from phototaxis.runtime.ports import free_ports
from phototaxis.task import ACTIONS, PERCEPTS
from phototaxis.wire.messages import AgentLog, EndedEpisode, SensorsLog, SimLog, World
from phototaxis_recorder import policy_map
from phototaxis_recorder.colors import of_distance, of_reward
from phototaxis_recorder.field import CELLS_A_SIDE, light_field
from phototaxis_recorder.file import fresh_file
from phototaxis_recorder.recordings import DAY_S, MEGABYTE_BYTES, excess
from phototaxis_recorder.sinks import RecordingSinks
from phototaxis_recorder.summary import RecordingFile, Summary, summary_file
from phototaxis_recorder.translate import Translator
from phototaxis_sensors.light import LightModel
from phototaxis_sensors.model import PastMoment
from phototaxis_sensors.scene import Scene
from rerun_files import salvaged, series


def test_the_field_is_what_an_eye_there_reads():
    arena = Arena("a", (6.0, 6.0), [Light((3.0, 3.0))], walls=[Wall((1.5, 2.0), (1.5, 4.0))])
    arena = msgspec.structs.replace(
        arena,
        robot=msgspec.structs.replace(arena.robot, light_sensors=((0.0, 0.0), (0.0, 0.0))),
        sensing=msgspec.structs.replace(arena.sensing, body_shadow=False),
    )
    field, eye = light_field(arena), LightModel(arena, Scene(arena))
    assert field.shape == (CELLS_A_SIDE, CELLS_A_SIDE)
    cell = 6.0 / CELLS_A_SIDE
    for row, column in ((5, 5), (60, 10), (60, 40), (90, 100), (60, 60)):
        x, y = (column + 0.5) * cell, (row + 0.5) * cell
        assert field[row, column] == pytest.approx(eye(PastMoment(0, 0, x, y, 0.0))[0], abs=1e-9)
    assert field[60, 10] == 0.0, "behind the wall"


def test_colours_tell_near_from_far_and_good_from_bad():
    near, far = (color.tobytes() for color in of_distance(np.array([0.1, 6.0])))
    bad, none, good, unknown = of_reward(np.array([-2.0, 0.0, 3.0, np.nan])).tolist()
    assert near != far
    assert len({bad, none, good}) == 3
    assert unknown == none


@pytest.mark.parametrize("name", ["simple", "rich"])
def test_each_state_has_its_place_in_the_picture_of_the_policy(name: str):
    places = policy_map.cells(PERCEPTS[name].sizes)
    assert len({tuple(place) for place in places.tolist()}) == len(places) == np.prod(PERCEPTS[name].sizes)
    assert (places > 0).all()
    assert (places < (policy_map.WIDTH, policy_map.HEIGHT)).all()


def test_the_policy_shows_where_it_moves_stands_and_knows_nothing():
    percept = PERCEPTS["simple"]
    table, visits = np.zeros((24, 9)), np.zeros(24, int)
    table[5, ACTIONS.index((1.0, 1.0))], visits[5], visits[6] = 1.0, 3, 1
    moving, still = policy_map.arrows(percept, table, visits)
    assert moving.vectors is not None
    assert still.positions is not None
    assert len(moving.vectors.as_arrow_array()) == 1
    assert len(still.positions.as_arrow_array()) == 23


def test_the_arrow_points_where_the_action_drives():
    assert policy_map.heading(ACTIONS.index((1.0, 1.0)))[1] < 0, "forward is up"
    assert policy_map.heading(ACTIONS.index((-1.0, 1.0)))[0] < 0, "a turn to the left points left"
    assert policy_map.heading(ACTIONS.index((0.0, 0.0))) == (0.0, 0.0)


def test_old_and_excessive_recordings_go_and_the_one_in_use_stays():
    now = 100.0 * DAY_S
    found = [RecordingFile(Path(str(age)), 10 * MEGABYTE_BYTES, now - age * DAY_S, None) for age in (0, 1, 2, 3)]
    assert excess(found, now, None, None) == []
    assert [one.file.name for one in excess(found, now, 1.5, None)] == ["2", "3"]
    assert [one.file.name for one in excess(found, now, None, 25)] == ["2", "3"]
    assert [one.file.name for one in excess(found, now, 0, 0)] == ["1", "2", "3"]


def test_a_percept_that_nobody_knows_is_recorded_without_a_picture_of_its_states(tmp_path: Path, paper: Arena):
    recording = rr.RecordingStream("phototaxis", recording_id="r")
    recording.save(str(tmp_path / "r.rrd"))
    translator = Translator(recording, World(run="r", arena=paper, seed=0, epochs=0))
    one = [0.5, 0.5]
    translator.agent(AgentLog(
        run="r", seq=0, writer="w", learner="mine", percept="camera", tick=[0, 1], state=[0, 0], action=[4, 4],
        reward=one, td_error=one, temperature=one, values=[1.0] * 7, visits=[1], current=[2.0] * 9,
    ))  # fmt: skip
    translator.flush(last=True)
    recording.disconnect()
    assert sorted(series(tmp_path / "r.rrd", "/plots/reward", "Scalars:scalars")) == [0, 1]
    assert len(series(tmp_path / "r.rrd", "/learner/current", "BarChart:values")) == 1
    assert not series(tmp_path / "r.rrd", "/learner/table", "Tensor:data")


def test_a_pose_that_nobody_sensed_has_no_rays_of_another(tmp_path: Path, paper: Arena):
    recording = rr.RecordingStream("phototaxis", recording_id="r")
    recording.save(str(tmp_path / "r.rrd"))
    translator = Translator(recording, World(run="r", arena=paper, seed=0, epochs=0))
    none, place = [0, 0, 0], [1.0, 1.0, 1.0]
    translator.sim(SimLog(
        run="r", seq=0, writer="s", driver="", tick=[0, 1, 2], episode=none, time=place, x=place, y=place,
        heading=place, left=place, right=place, contact=none, ended=[],
    ))  # fmt: skip
    translator.sensors(SensorsLog(
        run="r", seq=0, writer="s", sonar_model="built-in", light_model="built-in", tick=[0, 1], sonar=[1.0] * 32,
        light=[0.5] * 4,
    ))  # fmt: skip
    translator.flush(last=True)
    recording.disconnect()
    assert sorted(series(tmp_path / "r.rrd", "/world/trail", "Points2D:positions")) == [0, 1, 2]
    assert sorted(series(tmp_path / "r.rrd", "/world/robot/sonar", "Clear:is_recursive")) == [2]


def moved(first: int, ticks: int) -> SimLog:
    """So many ticks of poses, which differ, so that a recording of them has its size."""
    tick, none = list(range(first, first + ticks)), [0] * ticks
    x, ones = np.random.default_rng(first).uniform(1, 9, ticks).tolist(), [1.0] * ticks
    return SimLog(
        run="r", seq=first, writer="s", driver="", tick=tick, episode=none, time=ones, x=x, y=x, heading=ones,
        left=ones, right=ones, contact=none, ended=[],
    )  # fmt: skip


@pytest.fixture
def recording(tmp_path: Path, paper: Arena) -> RecordingSinks:
    """A recording of the run "r" into r.rrd."""
    return RecordingSinks(
        World(run="r", arena=paper, seed=0, epochs=0), tmp_path / "r.rrd", "127.0.0.1", free_ports(1)[0], "16MiB"
    )


def record(recording: RecordingSinks, until: int) -> None:
    """A hundred ticks at a time."""
    for first in range(0, until, 100):
        recording.translator.sim(moved(first, 100))
        recording.translator.flush(last=True)
        recording.keep()


def test_a_recording_that_cannot_grow_ends_with_its_summary(recording: RecordingSinks, capfd):
    record(recording, 100)
    with no_file_larger_than(recording.file.stat().st_size + 30_000):
        record(recording, 3000)
        recording.close()
    summary = msgspec.json.decode(summary_file(recording.file).read_bytes(), type=Summary)
    kept = series(salvaged(recording.file), "/world/trail", "Points2D:positions")
    assert 0 < summary.tick < 2999
    assert sorted(kept) == list(range(summary.tick + 1))
    assert recording.kept == summary.tick
    assert recording.fault == f"{recording.file}: File too large; recorded up to tick {summary.tick}"
    said = f"phototaxis: warning: {recording.fault}\n"
    assert capfd.readouterr().err.count(said) == 1
    assert not [path for path in recording.file.parent.iterdir() if path.suffix in (".new", ".part")]


def test_a_recording_that_never_began_leaves_no_file(recording: RecordingSinks):
    with no_file_larger_than(20_000):
        record(recording, 300)
        recording.close()
    assert recording.kept == -1
    assert not list(recording.file.parent.glob("*.rrd"))


def test_a_recording_whose_folder_is_gone_says_so(recording: RecordingSinks):
    record(recording, 100)
    shutil.rmtree(recording.file.parent)
    record(recording, 200)
    recording.close()
    assert recording.fault == f"{recording.file}: No such file or directory; recorded up to tick 99"
    assert recording.kept == 99


def test_a_recording_without_a_place_is_a_live_view(tmp_path: Path, paper: Arena):
    wanted = tmp_path / "gone" / "r.rrd"
    recording = RecordingSinks(
        World(run="r", arena=paper, seed=0, epochs=0), wanted, "127.0.0.1", free_ports(1)[0], "16MiB"
    )
    record(recording, 100)
    recording.close()
    assert recording.fault == f"{wanted}: No such file or directory; nothing is recorded"


def test_low_space_is_told_once(recording: RecordingSinks, monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9 - 10**7, 10**7))
    record(recording, 300)
    recording.close()
    assert capsys.readouterr().err.count("less than 200 MB are left on its disk") == 1
    assert not recording.fault


def test_no_recording_is_overwritten(tmp_path: Path):
    assert [fresh_file(tmp_path / "r.rrd").name for _ in range(3)] == ["r.rrd", "r-2.rrd", "r-3.rrd"]


def test_ticks_without_a_command_are_told_in_a_few_lines(tmp_path: Path, paper: Arena):
    recording, told = rr.RecordingStream("test"), []
    translator = Translator(recording, World(run="r", arena=paper, seed=0, epochs=0))
    translator._text = lambda tick, text, *_: told.append(text)  # type: ignore[method-assign] - heard in place of Rerun
    for tick, late in enumerate([0, 0, 1, 1, 3, 4, 5, 6]):
        at = [0.0]
        translator.sim(SimLog(
            run="r", seq=tick, writer="s", driver="", tick=[tick], episode=[0], time=at, x=at, y=at, heading=at,
            left=at, right=at, contact=[0], ended=[], late=late,
        ))  # fmt: skip
    assert told == [f"{late} ticks without a command in time so far" for late in (1, 3, 6)]


@pytest.mark.parametrize(
    ("learner", "percept", "light", "arena", "shown"),
    [
        ("qtable", "simple", "built-in", "paper", True),
        ("mirror", "simple", "built-in", "paper", False),
        ("qtable", "rich", "built-in", "paper", False),
        ("qtable", "simple", "lag.fmu", "paper", False),
        ("qtable", "simple", "built-in", "mine", False),
    ],
)
def test_the_papers_line_stands_beside_the_papers_system_alone(
    tmp_path: Path, paper: Arena, learner: str, percept: str, light: str, arena: str, shown: bool
):
    recording = rr.RecordingStream("phototaxis", recording_id="r")
    recording.save(str(tmp_path / "r.rrd"))
    translator = Translator(
        recording, World(run="r", arena=msgspec.structs.replace(paper, name=arena), seed=0, epochs=0)
    )
    ended = EndedEpisode(run="r", episode=0, tick=1, steps=1, end="terminated", driver="a", x=0.0, y=0.0, heading=0.0)
    none, one = [0, 0], [1.0, 1.0]
    translator.sim(SimLog(
        run="r", seq=0, writer="s", driver="a", tick=[0, 1], episode=none, time=one, x=one, y=one, heading=one,
        left=one, right=one, contact=none, ended=[ended],
    ))  # fmt: skip
    translator.sensors(SensorsLog(
        run="r", seq=0, writer="s", sonar_model="built-in", light_model=light, tick=[0, 1], sonar=[1.0] * 32,
        light=[0.5] * 4,
    ))  # fmt: skip
    translator.agent(AgentLog(
        run="r", seq=0, writer="a", learner=learner, percept=percept, tick=[0, 1], state=none, action=none, reward=one,
        td_error=one, temperature=one,
    ))  # fmt: skip
    translator.flush(last=True)
    recording.disconnect()
    assert len(series(tmp_path / "r.rrd", "/plots/success/rate", "Scalars:scalars")) == 1
    assert bool(series(tmp_path / "r.rrd", "/plots/success/paper", "Scalars:scalars")) is shown
