"""What the live view is made of: light, colours, policy; and which recordings are removed."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
import rerun as rr
from phototaxis.arena import Arena, Light, Wall
from phototaxis.messages import AgentLog, Episode, SensorsLog, SimLog, World
from phototaxis.recordings import Recording
from phototaxis.task import ACTIONS, PERCEPTS
from phototaxis_launcher.recordings import DAY, MEGABYTE, excess
from phototaxis_recorder import policy
from phototaxis_recorder.colors import of_distance, of_reward
from phototaxis_recorder.field import CELLS, light_field
from phototaxis_recorder.translate import Translator
from phototaxis_sensors.light import LightModel
from phototaxis_sensors.model import Past
from phototaxis_sensors.scene import Scene
from rerun_files import series


def test_the_field_is_what_an_eye_there_reads():
    arena = Arena("a", (6.0, 6.0), [Light((3.0, 3.0))], walls=[Wall((1.5, 2.0), (1.5, 4.0))])
    arena = msgspec.structs.replace(
        arena,
        robot=msgspec.structs.replace(arena.robot, light_sensors=((0.0, 0.0), (0.0, 0.0))),
        sensing=msgspec.structs.replace(arena.sensing, body_shadow=False),
    )
    field, eye = light_field(arena), LightModel(arena, Scene(arena))
    assert field.shape == (CELLS, CELLS)
    cell = 6.0 / CELLS
    for row, column in ((5, 5), (60, 10), (60, 40), (90, 100), (60, 60)):
        x, y = (column + 0.5) * cell, (row + 0.5) * cell
        assert field[row, column] == pytest.approx(eye(Past(0, 0, x, y, 0.0))[0], abs=1e-9)
    assert field[60, 10] == 0.0, "behind the wall"


def test_colours_tell_near_from_far_and_good_from_bad():
    near, far = (color.tobytes() for color in of_distance(np.array([0.1, 6.0])))
    bad, none, good, unknown = of_reward(np.array([-2.0, 0.0, 3.0, np.nan])).tolist()
    assert near != far
    assert len({bad, none, good}) == 3
    assert unknown == none


@pytest.mark.parametrize("name", ["simple", "rich"])
def test_each_state_has_its_place_in_the_picture_of_the_policy(name: str):
    places = policy.cells(PERCEPTS[name].sizes)
    assert len({tuple(place) for place in places.tolist()}) == len(places) == np.prod(PERCEPTS[name].sizes)
    assert (places > 0).all()
    assert (places < (policy.WIDTH, policy.HEIGHT)).all()


def test_the_policy_shows_where_it_moves_stands_and_knows_nothing():
    percept = PERCEPTS["simple"]
    table, visits = np.zeros((24, 9)), np.zeros(24, int)
    table[5, ACTIONS.index((1.0, 1.0))], visits[5], visits[6] = 1.0, 3, 1
    moving, still = policy.arrows(percept, table, visits)
    assert moving.vectors is not None
    assert still.positions is not None
    assert len(moving.vectors.as_arrow_array()) == 1
    assert len(still.positions.as_arrow_array()) == 23


def test_the_arrow_points_where_the_action_drives():
    assert policy.heading(ACTIONS.index((1.0, 1.0)))[1] < 0, "forward is up"
    assert policy.heading(ACTIONS.index((-1.0, 1.0)))[0] < 0, "a turn to the left points left"
    assert policy.heading(ACTIONS.index((0.0, 0.0))) == (0.0, 0.0)


def test_old_and_excessive_recordings_go_and_the_one_in_use_stays():
    now = 100.0 * DAY
    found = [Recording(Path(str(age)), 10 * MEGABYTE, now - age * DAY, None) for age in (0, 1, 2, 3)]
    assert excess(found, now, None, None) == []
    assert [one.file.name for one in excess(found, now, 1.5, None)] == ["2", "3"]
    assert [one.file.name for one in excess(found, now, None, 25)] == ["2", "3"]
    assert [one.file.name for one in excess(found, now, 0, 0)] == ["1", "2", "3"]


def test_a_percept_that_nobody_knows_is_recorded_without_a_picture_of_its_states(tmp_path: Path, paper: Arena):
    recording = rr.RecordingStream("phototaxis", recording_id="r")
    recording.save(str(tmp_path / "r.rrd"))
    translator = Translator(recording, World("r", paper, 0, 0))
    one = [0.5, 0.5]
    translator.agent(
        AgentLog("r", 0, "w", "mine", "camera", [0, 1], [0, 0], [4, 4], one, one, one, [1.0] * 7, [1], [2.0] * 9)
    )
    translator.flush(last=True)
    recording.disconnect()
    assert sorted(series(tmp_path / "r.rrd", "/plots/reward", "Scalars:scalars")) == [0, 1]
    assert len(series(tmp_path / "r.rrd", "/learner/current", "BarChart:values")) == 1
    assert not series(tmp_path / "r.rrd", "/learner/table", "Tensor:data")


def test_a_pose_that_nobody_sensed_has_no_rays_of_another(tmp_path: Path, paper: Arena):
    recording = rr.RecordingStream("phototaxis", recording_id="r")
    recording.save(str(tmp_path / "r.rrd"))
    translator = Translator(recording, World("r", paper, 0, 0))
    none, place = [0, 0, 0], [1.0, 1.0, 1.0]
    translator.sim(SimLog("r", 0, "s", "", [0, 1, 2], none, place, place, place, place, place, place, none, []))
    translator.sensors(SensorsLog("r", 0, "s", "built-in", "built-in", [0, 1], [1.0] * 32, [0.5] * 4))
    translator.flush(last=True)
    recording.disconnect()
    assert sorted(series(tmp_path / "r.rrd", "/world/trail", "Points2D:positions")) == [0, 1, 2]
    assert sorted(series(tmp_path / "r.rrd", "/world/robot/sonar", "Clear:is_recursive")) == [2]


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
    translator = Translator(recording, World("r", msgspec.structs.replace(paper, name=arena), 0, 0))
    ended = Episode(run="r", episode=0, tick=1, steps=1, end="reached", driver="a", x=0.0, y=0.0, heading=0.0)
    none, one = [0, 0], [1.0, 1.0]
    translator.sim(SimLog("r", 0, "s", "a", [0, 1], none, one, one, one, one, one, one, none, [ended]))
    translator.sensors(SensorsLog("r", 0, "s", "built-in", light, [0, 1], [1.0] * 32, [0.5] * 4))
    translator.agent(AgentLog("r", 0, "a", learner, percept, [0, 1], none, none, one, one, one))
    translator.flush(last=True)
    recording.disconnect()
    assert len(series(tmp_path / "r.rrd", "/plots/success/rate", "Scalars:scalars")) == 1
    assert bool(series(tmp_path / "r.rrd", "/plots/success/paper", "Scalars:scalars")) is shown
