"""Learners that fail on the bus, and a speed that nobody can keep: the run ends at once and says why."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from phototaxis.runtime.bus import Bus
from phototaxis.runtime.session import BusOptions, open_session
from phototaxis_sensors.suite import SensorSuite
from support import children, observer, phototaxis, result, wait, wait_status

LEARNERS = '''
import os, time
import numpy as np
from phototaxis_agent.learners.qtable import QTable


class Numpy(QTable):
    """What most people write: NumPy's numbers."""

    def values(self, state):
        return np.array(super().values(state))

    def learn(self, transition):
        return np.float64(super().learn(transition))


class Faulty(QTable):
    """Fails at the 20th step."""

    steps = 0

    def learn(self, transition):
        self.steps += 1
        if self.steps == 20:
            self.fail()
        return super().learn(transition)


class Raises(Faulty):
    def fail(self):
        raise KeyError("my bug")


class Leaves(Faulty):
    def fail(self):
        os._exit(0)


class Hangs(Faulty):
    def fail(self):
        time.sleep(1000)


class Forgets(QTable):
    def load(self, arrays):
        pass


class Slow(QTable):
    def values(self, state):
        time.sleep(0.02)
        return super().values(state)
'''


@pytest.fixture(autouse=True)
def learners(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A distribution of learners on the path, as pip would install it."""
    about = tmp_path / "site" / "faulty_learners-1.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: faulty-learners\nVersion: 1\n")
    names = "numpy", "raises", "leaves", "hangs", "forgets", "slow"
    lines = [f"t-{name} = faulty_learners:{name.title()}" for name in names]
    (about / "entry_points.txt").write_text("\n".join(["[phototaxis.learners]", *lines]))
    (about.parent / "faulty_learners.py").write_text(LEARNERS)
    monkeypatch.setenv("PYTHONPATH", str(about.parent))


def test_a_learner_of_numpy_numbers_gives_the_same_run_here_and_on_the_bus(up):
    words = "--learner", "t-numpy", "--epochs", 200
    found = result(up(*words, "--no-recorder"))
    alone = phototaxis("train", *words, "--json")
    assert found["learner_hash"] in alone.stdout
    assert found["restarts"] == {}


@pytest.mark.parametrize(
    ("learner", "expected"),
    [
        ("t-raises", "agent: learner t-raises: learn() raised KeyError: 'my bug' ("),
        ("t-forgets", "agent: learner t-forgets: load() does not bring back what save() gave"),
        ("t-leaves", "agent (learner t-leaves) died 4 times, last with exit code 0, before its time"),
    ],
)
def test_a_learner_that_fails_ends_the_run_and_is_named(up, learner, expected):
    launcher = up("--learner", learner, "--epochs", 40, "--no-recorder")
    assert launcher.end() == 4
    last = next(line for line in launcher.stderr.splitlines() if line.startswith("phototaxis: error: "))
    assert expected in last
    assert ("faulty_learners.py, line" in last) == (learner == "t-raises")
    assert "Traceback" not in launcher.stderr


def test_a_learner_that_hangs_is_named_while_the_run_waits(up, world):
    launcher = up("--learner", "t-hangs", "--epochs", 40, "--no-recorder")
    with observer(world) as bus:
        wait_status(bus, lambda status: status.waited > 5.2, launcher)
        wait_status(bus, lambda status: "does not answer tick" in launcher.stderr, launcher)
    assert "t-hangs-" in launcher.stderr
    launcher.popen.terminate()
    os.kill(children(launcher.popen.pid)["agent"], signal.SIGKILL)  # it would be waited for


def test_a_process_that_dies_in_an_experiment_names_its_learner(tmp_path):
    done = phototaxis("experiment", "--learners", "t-leaves", "--seeds", "0:2", "--epochs", 40, "--out", tmp_path / "x")
    assert done.returncode == 4
    assert "learners: t-leaves" in done.stderr.splitlines()[-1]


def test_a_speed_that_nobody_can_keep_is_an_error_and_names_the_slower_part(up, world):
    launcher = up("--learner", "t-slow", "--epochs", 150, "--no-recorder", "--speed", 100)
    with observer(world) as bus:
        status = wait_status(bus, lambda status: bool(status.too_slow), launcher)
        assert "t-slow-" in status.too_slow
    assert launcher.end() == 4
    assert '"late_ticks": 150' in launcher.stdout
    assert "only 0 of 150 ticks had a command in time" in launcher.stderr.splitlines()[-1]
    assert "is too slow: " in launcher.stderr


def test_sensors_that_are_always_a_tick_late_are_named(start, world):
    sim = start("sim", "--name", world, "--speed", 100)
    name = BusOptions(name=world)
    with open_session("sensors", name) as session, Bus(session, world, "sensors", "sensors-late") as sensors:
        state = wait(sensors, lambda event: event.topic == "state", sim).message
        suite = SensorSuite(sensors.ask_one("world"))
        agent = start("agent", "--name", world)
        with observer(world) as bus:
            status = None
            while status is None or not status.too_slow:
                following = wait(sensors, lambda event: event.topic == "state", sim, agent).message
                readings = suite(state)
                readings.driver = following.driver
                sensors.put("readings", readings)
                state = following
                heard = bus.receive(timeout=0)
                status = heard.message if heard is not None and heard.topic == "status" else status
    assert status.too_slow.startswith("sensors-late is too slow: ")
    assert status.late_sensors > status.late / 2


def test_a_thread_that_a_learner_leaves_behind_does_not_keep_the_program():
    thread = "threading.Thread(target=time.sleep, args=[1e5]).start()"
    code = f"import threading, time; from phototaxis.runtime.errors import leave; {thread}; leave(3)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 3
    assert "a learner's threads should be daemons" in done.stderr
