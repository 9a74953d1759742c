"""FMUs in a running system, and bad ones: each is one clear line, and leaves nothing behind."""

import os
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from fmus import FAULTS, Built, altered, described, edited, workers
from phototaxis_fmu.build import build
from phototaxis_fmu.examples import EXAMPLES
from rerun_files import series
from support import children, observer, phototaxis, result, wait_alive, wait_status

VERSIONS = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture(autouse=True)
def nothing_is_left(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No folder, no process; the working directory is where it was."""
    temporary, here = tmp_path_factory.mktemp("tmp"), os.getcwd()
    monkeypatch.setenv("TMPDIR", str(temporary))
    yield
    assert workers() == []
    assert list(temporary.glob("phototaxis-fmu-*")) == []
    assert os.getcwd() == here


def refused(line: str, *words: object, code: int = 2) -> None:
    """A command ends with one line that says this."""
    done = phototaxis(*words)
    assert done.returncode == code, done.stderr
    lines = done.stderr.splitlines()
    assert lines[-1].startswith("phototaxis: error: ")
    assert line in lines[-1]
    assert "Traceback" not in done.stderr


def no_describe(name: str, data: bytes) -> tuple[str, bytes] | None:
    return None if name == "modelDescription.xml" else (name, data)


def elsewhere(name: str, data: bytes) -> tuple[str, bytes] | None:
    folder = name.split("/")[0]
    if folder == "sources":
        return None
    return (f"binaries/win64/{Path(name).stem}.dll", data) if folder == "binaries" else (name, data)


def corrupt(name: str, data: bytes) -> tuple[str, bytes]:
    return name, b"\x7fELF, but nothing follows" if name.startswith("binaries/") else data


def broken_xml(name: str, data: bytes) -> tuple[str, bytes]:
    return name, data[: len(data) // 2] if name == "modelDescription.xml" else data


EDITED: dict[str, tuple[Callable[[str, bytes], tuple[str, bytes] | None], str]] = {
    "no description": (no_describe, "not an FMU: it has no modelDescription.xml"),
    "broken XML": (broken_xml, "its modelDescription.xml is not XML"),
    "another platform": (elsewhere, "for this machine"),
    "corrupt library": (corrupt, "its library cannot be loaded"),
}


@VERSIONS
@pytest.mark.parametrize("case", EDITED)
def test_a_damaged_archive(fmu: Built, tmp_path, version, case):
    edit, line = EDITED[case]
    refused(line, "sensors", "--light-fmu", edited(fmu("light", version), tmp_path / "bad.fmu", edit))


TOKEN = {2: 'guid="{', 3: 'instantiationToken="{'}
FMI = {2: 'fmiVersion="2.0"', 3: 'fmiVersion="3.0"'}
DESCRIBED = {
    "wrong version": (FMI, 'fmiVersion="1.0"', "its FMI version is 1.0; it must be 2.0 or 3.0"),
    "unknown version": (FMI, 'fmiVersion="9.1"', "its FMI version is 9.1"),
    "schema": ({2: "causality=", 3: "causality="}, "casuality=", "its modelDescription.xml is not valid"),
    "wrong token": (TOKEN, {2: 'guid="{0', 3: 'instantiationToken="{0'}, "cannot be instantiated (the "),
    "wrong causality": (
        {2: 'causality="output"', 3: 'causality="output"'}, 'causality="local"', "reading has causality local",
    ),
}  # fmt: skip


@VERSIONS
@pytest.mark.parametrize("case", DESCRIBED)
def test_a_description_that_does_not_fit(fmu: Built, tmp_path, version, case):
    old, new, line = DESCRIBED[case]
    changed = new[version] if isinstance(new, dict) else new
    file = described(fmu("light", version), tmp_path / "bad.fmu", old[version], changed)
    refused(line, "sensors", "--light-fmu", file)


@VERSIONS
def test_model_exchange_alone(fmu: Built, tmp_path, version):
    file = described(fmu("light", version), tmp_path / "x.fmu", "CoSimulation", "ModelExchange")
    file = described(file, tmp_path / "bad.fmu", ' canHandleVariableCommunicationStepSize="true"', "")
    refused("supports only Model Exchange", "sensors", "--light-fmu", file)


@VERSIONS
def test_sources_alone_are_compiled_only_when_allowed(tmp_path, version):
    file = tmp_path / "lag.fmu"
    build(EXAMPLES["lag"], version, file, sources_only=True)
    refused("has only C sources; add --allow-compile", "sensors", "--light-fmu", file)
    done = phototaxis("fmu", "check", file, "--allow-compile")
    assert done.returncode == 0, done.stderr
    assert "light: 400 ticks" in done.stdout


@VERSIONS
def test_a_library_without_a_function(tmp_path, version):
    example = EXAMPLES["lag"]
    file, source = tmp_path / "a.fmu", tmp_path / "b.fmu"
    build(example, version, source, sources_only=True)

    def without(name: str, data: bytes) -> tuple[str, bytes]:
        return name, data.replace(f"fmi{version}DoStep".encode(), b"no_step") if name.endswith(".c") else data

    refused("its library lacks a function", "fmu", "check", edited(source, file, without), "--allow-compile")


def test_what_is_not_even_an_archive(tmp_path):
    (tmp_path / "text.fmu").write_text("hello")
    refused("not an FMU: it is not a zip archive", "sensors", "--light-fmu", tmp_path / "text.fmu")
    refused("there is no such file", "sensors", "--light-fmu", tmp_path / "none.fmu")
    refused("not an FMU", "fmu", "info", tmp_path)


def test_an_archive_that_cannot_be_unpacked(fmu: Built, tmp_path):
    whole = fmu("light", 3).read_bytes()
    with zipfile.ZipFile(fmu("light", 3)) as archive:
        for name, text in (
            ("binaries/", "cannot be unpacked: Bad CRC-32"),
            ("modelDescription.xml", "cannot be unpacked"),
        ):
            member = next(one for one in archive.infolist() if one.filename.startswith(name) and one.file_size)
            at = member.header_offset + 30 + len(member.filename) + member.compress_size // 2
            damaged = tmp_path / "damaged.fmu"
            damaged.write_bytes(whole[:at] + bytes([whole[at] ^ 255]) + whole[at + 1 :])
            refused(text, "sensors", "--light-fmu", damaged)


SAID = {
    "error": "returned an error at tick",
    "discard": "returned discard at tick",
    "NaN": "its y is nan, not in 0 to 5",
    "out of range": "its y is 7, not in 0 to 5",
    "segfault": "crashed with SIGSEGV",
    "endless": "gave no answer within 0.3 s and was ended",
    "exits": "ended its process with code 3",
}


@VERSIONS
@pytest.mark.parametrize("case", SAID)
def test_an_fmu_that_fails_again_and_again_ends_the_command(fmu: Built, version, case):
    words = ["--fmu-param", f"fault={FAULTS[case]}", "--fmu-timeout", 0.3]
    done = phototaxis("fmu", "check", fmu("faulty", version), "--kind", "light", *words)
    assert done.returncode == 4
    lines = done.stderr.splitlines()
    assert len(lines) == 4, "three restarts and the end"
    assert all(SAID[case] in line for line in lines), done.stderr
    assert lines[-1].endswith("after 3 restarts")


@VERSIONS
def test_an_fmu_that_does_not_repeat_itself_is_found_out(fmu: Built, version):
    words = ["--fmu-param", f"fault={FAULTS['forgets']}"]
    refused("after a reset the same inputs give other readings", "fmu", "check", fmu("faulty", version), *words)


def test_info_names_what_maps_onto_what(fmu: Built):
    done = phototaxis("fmu", "info", fmu("photodiode", 3))
    assert done.returncode == 0
    assert "as a light sensor: distance = distance, bearing = bearing" in done.stdout
    assert "as a sonar sensor: no;" in done.stdout
    assert "half" in done.stdout


@VERSIONS
def test_a_run_with_the_built_in_law_as_an_fmu_is_the_same_run(fmu: Built, up, version):
    words = "--epochs", 3000, "--seed", 7
    plain = result(up(*words, "--no-recorder"))
    foreign = result(up(*words, "--light-fmu", fmu("light", version)))
    assert foreign["state_hash"] == plain["state_hash"]
    assert foreign["learner_hash"] == plain["learner_hash"]
    models = series(foreign["recording"], "/world/robot/light_model", "TextDocument:text")
    assert [text[0] for text in models.values()] == [f"light{version}.fmu"]


def test_a_killed_fmu_and_killed_sensors_change_nothing(fmu: Built, up, world):
    words = "--epochs", 2000, "--seed", 3, "--light-fmu", fmu("lag", 3), "--fmu-param", "tau=0.3", "--no-recorder"
    whole = result(up(*words))
    launcher = up(*words)
    with observer(world) as bus:
        for epoch in (400, 800, 1200):
            wait_status(bus, lambda status, epoch=epoch: status.epoch > epoch, launcher)
            sensors = children(launcher.popen.pid)["sensors"]
            worker = psutil.Process(sensors).children()[0]
            os.kill(sensors if epoch == 800 else worker.pid, signal.SIGKILL)
    found = result(launcher)
    assert found["restarts"] == {"sensors": 1}
    assert (found["state_hash"], found["learner_hash"]) == (whole["state_hash"], whole["learner_hash"])


def test_an_fmu_takes_the_place_of_the_model_of_a_running_learner(fmu: Built, start, world, tmp_path):
    place = ["--name", world]
    sim = start("sim", *place, "--seed", 3, "--epochs", 2000, "--run", "swapped")
    recorder = start("recorder", *place, "--output", tmp_path / "r.rrd", "--grpc-port", 0, "--web-port", -1)
    first = start("sensors", *place)
    with observer(world) as bus:
        wait_alive(bus, "recorder", sim, first, recorder)
        agent = start("agent", *place)
        wait_status(bus, lambda status: status.epoch > 500, sim, first, agent)
        assert first.stop() == 0
        second = start("sensors", *place, "--light-fmu", fmu("lag", 2))
        wait_status(bus, lambda status: status.phase == "finished", sim, second, agent, recorder)
        assert second.stop() == 0
        assert agent.stop() == 0
    assert recorder.stop() == 0
    assert "begun anew" not in second.stderr
    models = series(tmp_path / "r.rrd", "/world/robot/light_model", "TextDocument:text")
    assert [text[0] for _, text in sorted(models.items())] == ["built-in", "lag2.fmu"]
    assert sim.stop() == 0


def test_the_built_in_model_takes_over_only_if_asked(fmu: Built, up):
    faulty = "--light-fmu", fmu("faulty", 3), "--fmu-param", "fault=5", "--fmu-param", "at=20"
    asked = result(up("--epochs", 300, *faulty, "--fmu-fallback"))
    assert asked["finished"]
    models = series(asked["recording"], "/world/robot/light_model", "TextDocument:text")
    assert "built-in, as faulty3.fmu failed" in [text[0] for text in models.values()]
    ended = up("--epochs", 300, *faulty, "--no-recorder")
    assert ended.end() == 4
    assert "light FMU faulty3.fmu: crashed with SIGSEGV" in ended.stderr
    measured = phototaxis("evaluate", asked["checkpoint"], "--placements", 20, *faulty, "--fmu-fallback")
    assert measured.returncode == 0, measured.stderr
    assert "at tick 19, after 3 restarts; the built-in model takes its place" in measured.stderr
    assert phototaxis("evaluate", asked["checkpoint"], "--placements", 20, *faulty).returncode == 4


def test_nobody_outlives_killed_sensors(start, world, tmp_path):
    """Not even an FMU in an endless loop, nor a helper that it has started."""
    helper = 'if (!fork()) execlp("sleep", "sleep", "100000", NULL); if (m) begin(m);'
    code = {"if (m) begin(m);": helper, '#include "fmi2Functions.h"': '#include <unistd.h>\n#include "fmi2Functions.h"'}
    file = altered(tmp_path / "helped.fmu", "faulty", 2, code)
    place = ["--name", world]
    sim = start("sim", *place)
    words = "--fmu-param", "fault=6", "--fmu-param", "at=5", "--fmu-timeout", 600
    sensors = start("sensors", *place, "--light-fmu", file, *words)
    agent = start("agent", *place)
    with observer(world) as bus:
        status = wait_status(bus, lambda status: status.phase == "waiting" and status.tick > 2, sim, sensors, agent)
    assert status.tick <= 6
    left = psutil.Process(sensors.popen.pid).children(recursive=True)
    assert len(left) == 4, "the worker, its guard, and a helper of each of two instances"
    sensors.kill()
    gone, alive = psutil.wait_procs(left, 20)
    assert len(gone) == 4, alive


def test_training_and_evaluation_take_fmus_too(fmu: Built, tmp_path):
    file, lag = tmp_path / "c.npz", ("--light-fmu", fmu("lag", 3))
    trained = phototaxis("train", "--epochs", 200, "--checkpoint", file, *lag)
    assert trained.returncode == 0, trained.stderr
    measured = phototaxis("evaluate", file, "--placements", 20, *lag)
    assert measured.returncode == 0, measured.stderr
    assert "of 20 fresh placements" in measured.stdout
    refused("leave the FMU out", "train", "--seeds", "0:2", *lag)


def test_without_fmpy_it_says_what_to_install(fmu: Built):
    program = "import sys; sys.modules['fmpy'] = None\nfrom phototaxis_launcher.cli import main; main()"
    words = [sys.executable, "-c", program, "sensors", "--light-fmu", str(fmu("lag", 3))]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.strip().endswith("pip install 'phototaxis[fmu]'")


def test_an_fmu_in_python(tmp_path):
    example = Path(__file__).parents[2] / "examples" / "python_fmu.py"
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", example, "-d", tmp_path]
    subprocess.run(build, capture_output=True, check=True)
    file = tmp_path / "TiringEye.fmu"
    done = phototaxis("fmu", "check", file, "--fmu-param", "recovery=5")
    assert done.returncode == 0, done.stderr
    assert "light: 400 ticks in 8 episodes" in done.stdout
    assert "does not follow the standard: ModelStructure/InitialUnknowns" in done.stderr


def test_what_an_fmu_in_python_raises_is_told(tmp_path):
    (tmp_path / "blind.py").write_text(
        """from pythonfmu import Fmi2Causality, Fmi2Slave, Real
class Blind(Fmi2Slave):
    def __init__(self, **more):
        super().__init__(**more)
        self.u = self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
    def do_step(self, now, step):
        raise ValueError("the calibration table is empty")
"""
    )
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", tmp_path / "blind.py", "-d", tmp_path]
    subprocess.run(build, capture_output=True, check=True)
    refused(
        "ValueError('the calibration table is empty')",
        "fmu",
        "check",
        tmp_path / "Blind.fmu",
        "--kind",
        "light",
        code=4,
    )
    trained = phototaxis("train", "--epochs", 10, "--light-fmu", tmp_path / "Blind.fmu")
    assert trained.returncode == 4
    assert "ValueError('the calibration table is empty')" in trained.stderr.splitlines()[-1]


def test_a_run_with_an_fmu_that_cannot_be_reset_is_the_same_run(fmu: Built, up, tmp_path):
    old = "fmi2Status fmi2Reset(fmi2Component c) { return begin(c), fmi2OK; }"
    broken = altered(
        tmp_path / "lag2.fmu", "lag", 2, {old: "fmi2Status fmi2Reset(fmi2Component c) { return fmi2Error; }"}
    )
    words = "--epochs", 600, "--seed", 7, "--no-recorder"
    good, odd = (result(up(*words, "--light-fmu", file)) for file in (fmu("lag", 2), broken))
    assert (odd["state_hash"], odd["learner_hash"]) == (good["state_hash"], good["learner_hash"])
    assert not odd["restarts"]
