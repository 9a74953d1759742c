"""FMUs as other tools make them: no reset, steps of their own, rounding, logs, helpers, prefixes; no bus."""

import math
import os
import re
import time
import zipfile
from pathlib import Path

import msgspec
import numpy as np
import psutil
import pytest
from fmus import Built, altered, described, edited
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.wire.messages import World
from phototaxis_fmu.build import Version, build
from phototaxis_fmu.description import read
from phototaxis_fmu.examples import EXAMPLES
from phototaxis_fmu.host import Host
from phototaxis_fmu.log import MAX_LINE_CHARACTERS, MAX_LINES, one_line
from phototaxis_fmu.pace import plan_steps
from phototaxis_fmu.sensors import FmuSensors
from phototaxis_fmu.start import start_value
from phototaxis_fmu.wiring import SUITES, connect
from phototaxis_sensors.model import PastMoment
from phototaxis_sensors.scene import Scene
from phototaxis_sensors.suite import built_in

VERSIONS = pytest.mark.parametrize("version", [2, 3])
RESET = {
    2: "fmi2Status fmi2Reset(fmi2Component c) { return begin(c), fmi2OK; }",
    3: "fmi3Status fmi3Reset(fmi3Instance i) { return begin(i), fmi3OK; }",
}
HEAD = {2: "fmi2Status fmi2Reset(fmi2Component c) {", 3: "fmi3Status fmi3Reset(fmi3Instance i) {"}
ONCE = {"canHandle": 'canBeInstantiatedOnlyOncePerProcess="true" canHandle'}


def drive(count: int, episode: int = 15) -> list[PastMoment]:
    """A robot that goes round the room."""
    angles = [0.7 * tick for tick in range(count)]
    return [
        PastMoment(t, t // episode, 5 + 4 * math.sin(a), 5 + 4 * math.cos(1.3 * a), a) for t, a in enumerate(angles)
    ]


class Makes:
    """Makes FMU sensors."""

    def __init__(self):
        self._made: list[FmuSensors] = []

    def __call__(self, **options) -> FmuSensors:
        self._made.append(FmuSensors(FmuOptions(**options)))
        return self._made[-1]

    def end(self) -> None:
        """End all of them: then what they said has been shown."""
        while self._made:
            self._made.pop().close()


@pytest.fixture
def sensors():
    """Makes FMU sensors that end with the test."""
    makes = Makes()
    yield makes
    makes.end()


def readings(make: FmuSensors, arena: Arena, moments: list[PastMoment], kind: str = "light") -> list[list[float]]:
    """What one kind of sensor reads on the way."""
    model = getattr(make(arena, Scene(arena)), kind)
    return [list(model(moment)) for moment in moments]


# -- resets


@pytest.mark.parametrize(
    ("version", "body", "description", "begins", "why"),
    [
        (2, "return 3;", {}, "a fresh instance", "fmi2Reset returned an error"),
        (3, "return 3;", {}, "a fresh instance", "fmi3Reset returned an error"),
        (3, "return 4;", {}, "a fresh process", "fmi3Reset returned a fatal error"),
        (2, "*(volatile int *)0 = 1; return 0;", {}, "a fresh process", "crashed with SIGSEGV"),
        (2, "exit(0);", {}, "a fresh process", "ended its process with code 0"),
        (3, "for (;;);", {}, "a fresh process", "gave no answer within 1 s"),
        (2, "return 3;", ONCE, "a fresh process", "fmi2Reset returned an error"),
    ],
)
def test_an_fmu_that_cannot_be_reset_goes_the_same_way(
    fmu: Built, paper: Arena, sensors, tmp_path: Path, capsys, version, body, description, begins, why
):
    odd = altered(tmp_path / "odd.fmu", "lag", version, {RESET[version]: f"{HEAD[version]} {body} }}"}, description)
    make, good = sensors(light_fmu=str(odd), fmu_timeout=1), sensors(light_fmu=str(fmu("lag", version)))
    assert readings(make, paper, drive(40)) == readings(good, paper, drive(40))
    assert make.begins == begins
    told = capsys.readouterr().err
    assert told.count("cannot be reset") == 1
    assert why in told
    assert f"each episode begins with {begins}" in told
    assert "restarted" not in told, "no failure"


def test_an_fmu_that_is_not_as_new_after_its_reset_gets_a_fresh_instance(
    fmu: Built, paper: Arena, sensors, tmp_path: Path
):
    """It accepts the reset, and refuses to be initialised a second time."""
    old = "fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return model_begin(c); }"
    new = old.replace("return", "Model *m = c; if (m->v[0]++ > 0) return 3; return")
    odd = altered(tmp_path / "odd.fmu", "lag", 2, {old: new, RESET[2]: f"{HEAD[2]} return 0; }}"})
    make = sensors(light_fmu=str(odd))
    assert readings(make, paper, drive(40)) == readings(sensors(light_fmu=str(fmu("lag", 2))), paper, drive(40))
    assert make.begins == "a fresh instance"


@VERSIONS
@pytest.mark.parametrize("description", [{}, ONCE])
def test_fresh_instances_on_request(fmu: Built, paper: Arena, sensors, tmp_path: Path, capsys, version, description):
    odd = altered(tmp_path / "odd.fmu", "lag", version, {RESET[version]: f"{HEAD[version]} abort(); }}"}, description)
    make, good = sensors(light_fmu=str(odd), fmu_fresh=True), sensors(light_fmu=str(fmu("lag", version)))
    assert readings(make, paper, drive(40)) == readings(good, paper, drive(40))
    assert make.begins == ("a fresh process" if description else "a fresh instance")
    assert capsys.readouterr().err == ""


def test_many_robots_with_an_fmu_that_cannot_be_reset(fmu: Built, paper: Arena, sensors, tmp_path: Path):
    odd = altered(tmp_path / "odd.fmu", "lag", 2, {RESET[2]: f"{HEAD[2]} return 3; }}"})
    world, poses = (
        World(run="w", arena=paper, seed=3, epochs=0),
        np.array([[moment.x, moment.y, moment.heading] for moment in drive(10)]),
    )
    both = [sensors(light_fmu=str(file)).batch(world, len(poses)) for file in (odd, fmu("lag", 2))]
    for tick in range(3):
        assert np.array_equal(both[0](tick, poses)[1], both[1](tick, poses)[1])


def test_an_fmu_that_fails_in_a_fresh_process_too_has_failed(paper: Arena, sensors, tmp_path: Path, capsys):
    code = {"y = m->state = u;": 'static int n; if (n++ || getenv("BAD")) return BROKEN; y = m->state = u;'}
    odd = altered(
        tmp_path / "odd.fmu", "lag", 2, {**code, "#include <math.h>": "#include <math.h>\n#include <stdlib.h>"}
    )
    make = sensors(sonar_fmu=str(odd), fmu_map=["range=u", "reading=y"], fmu_fallback=True)
    readings(make, paper, drive(3), "sonar")
    assert "after 3 restarts; the built-in model takes its place" in capsys.readouterr().err


# -- steps


def stepping(own: str, description: dict[str, str]) -> dict[str, str]:
    return {'canHandleVariableCommunicationStepSize="true"': own, **description}


@VERSIONS
def test_an_fmu_with_steps_of_its_own_gets_them(fmu: Built, paper: Arena, sensors, tmp_path: Path, capsys, version):
    code = {"double follow": "if (period != 0.1) return BROKEN; double follow"}
    experiment = {"<ModelVariables>": '<DefaultExperiment stepSize="0.1"/><ModelVariables>'}
    odd = altered(tmp_path / "odd.fmu", "lag", version, code, stepping("", experiment))
    good = sensors(light_fmu=str(fmu("lag", version)))
    found = readings(sensors(light_fmu=str(odd)), paper, drive(30))
    assert np.allclose(found, readings(good, paper, drive(30)), atol=1e-12), (
        "five steps are one of five times the length"
    )
    plain = altered(tmp_path / "plain.fmu", "lag", version, code)
    assert readings(sensors(light_fmu=str(plain), fmu_step=0.1), paper, drive(30)) == found
    assert capsys.readouterr().err == ""
    with pytest.raises(UserError, match=r"--fmu-step 0.3: the control period, 0.5 s, is not a whole number of steps"):
        readings(sensors(light_fmu=str(plain), fmu_step=0.3), paper, drive(1))


@pytest.mark.parametrize(
    ("interface", "step", "period", "expected"),
    [
        ('fixedInternalStepSize="0.05"', "", 0.5, (0.05, 10, "")),
        ('fixedInternalStepSize="0.05" canHandleVariableCommunicationStepSize="true"', "", 0.5, (0.05, 10, "")),
        ("", "0.5", 0.5, (0.5, 1, "")),
        ("", "0.3", 0.5, (0.5, 1, "has steps of 0.3 s; it gets")),
        ("", "1", 0.5, (0.5, 1, "has steps of 1 s; it gets")),
        ('canHandleVariableCommunicationStepSize="true"', "0.1", 0.5, (0.5, 1, r"\(for its own: --fmu-step 0.1\)")),
        ("", "1e-9", 0.5, (0.5, 1, "it gets steps of 0.5 s, the control period$")),
        ("", "0.50000000001", 0.5, (0.5, 1, "")),
        ('canHandleVariableCommunicationStepSize="true"', "0.16666666666667", 0.5, (0.5, 1, "step 0.16666666666667")),
        *[("", none, 0.5, (0.5, 1, "the control period$")) for none in ("NaN", "INF", "-0.1", "1e-320")],
        ("", "0.1", 0.3, (0.1, 3, "")),
    ],
)
def test_which_steps_an_fmu_gets(fmu: Built, tmp_path: Path, interface, step, period, expected):
    file = described(fmu("lag", 3), tmp_path / "a.fmu", 'canHandleVariableCommunicationStepSize="true"', interface)
    if step:
        wish = f'<DefaultExperiment stepSize="{step}"/><ModelVariables>'
        file = described(file, tmp_path / "b.fmu", "<ModelVariables>", wish)
    found = plan_steps(read(str(file)).description, period, 0.0)
    assert found[:2] == pytest.approx(expected[:2])
    assert re.search(expected[2], found.remark)
    assert bool(expected[2]) == bool(found.remark)


def test_a_step_that_is_no_length_is_refused(fmu: Built):
    with pytest.raises(UserError, match=r"the control period, 0.5 s, is not a whole number of steps"):
        plan_steps(read(str(fmu("lag", 2))).description, 0.5, 1e-320)


# -- limits


@pytest.mark.parametrize(
    ("value", "expected"),
    [("-1e-17", 0.0), ("5.0000000000000009", 5.0), ("5.000001", 5.0), ("-1e-7", 0.0), ("5.1", None), ("-0.1", None)],
)
def test_rounding_beyond_a_limit_is_put_back(paper: Arena, sensors, tmp_path: Path, value, expected):
    odd = altered(tmp_path / "odd.fmu", "faulty", 3, {"y = 7;": f"y = {value};"})
    words = {"fmu_param": ["fault=4", "at=1"], "fmu_map": ["reading=y"], "fmu_fallback": True}
    make = sensors(sonar_fmu=str(odd), **words)
    model = make(paper, Scene(paper)).sonar
    assert model(PastMoment(0, 0, 5, 5, 0)) == ([expected] * 16 if expected is not None else list(built(paper)))


def built(arena: Arena):
    return built_in(arena, Scene(arena)).sonar(PastMoment(0, 0, 5, 5, 0))


def test_readings_below_0_are_clipped_as_those_above_1(paper: Arena, sensors, tmp_path: Path):
    for value, expected in (("-0.3", 0.0), ("1.7", 1.0)):
        odd = altered(tmp_path / "odd.fmu", "lag", 3, {"y = m->state": f"y = {value}; m->state"})
        assert readings(sensors(light_fmu=str(odd)), paper, drive(2)) == [[expected] * 2] * 2


# -- what they say


SAYS = {
    2: 'if (m) begin(m); call->logger(call->componentEnvironment, name, fmi2%s, "c", %s);',
    3: 'if (m) begin(m); log(environment, fmi3%s, "c", %s);',
}


@VERSIONS
@pytest.mark.parametrize(
    ("status", "words", "shown"),
    [
        ("Warning", '"saturated"', ["logs warning: saturated"]),
        ("Error", '"a\\nb\\tc\\x01\\xff"', ["logs error: a b c��"]),
        ("OK", '"only on request"', []),
        ("Warning", "NULL", []),
        ("Warning", '""', []),
    ],
)
def test_warnings_are_shown(paper: Arena, sensors, tmp_path: Path, capsys, version, status, words, shown):
    said = SAYS[version] % (status, words)
    odd = altered(tmp_path / "odd.fmu", "lag", version, {"if (m) begin(m);": said})
    readings(sensors(light_fmu=str(odd)), paper, drive(1))
    sensors.end()
    assert capsys.readouterr().err.splitlines() == [f"sensors: light FMU odd.fmu {line}" for line in shown]


def test_messages_of_fmi_2_are_formatted(paper: Arena, sensors, tmp_path: Path, capsys):
    said = SAYS[2] % ("Warning", '"100%% of %s, %d and %g", "all", 42, 0.5')
    odd = altered(tmp_path / "odd.fmu", "lag", 2, {"if (m) begin(m);": said})
    readings(sensors(light_fmu=str(odd)), paper, drive(1))
    sensors.end()
    assert "logs warning: 100% of all, 42 and 0.5" in capsys.readouterr().err


@VERSIONS
def test_logging_is_on_by_request_and_after_a_failure(paper: Arena, sensors, tmp_path: Path, capsys, version):
    """A model that says why only when its logging is on."""
    said = "if (logging) " + (SAYS[version] % ("Warning", '"verbose"')).removeprefix("if (m) begin(m); ")
    code = {"if (m) begin(m);": f"if (m) begin(m); {said}"}
    odd = altered(tmp_path / "odd.fmu", "faulty", version, code)
    words = {"light_fmu": str(odd), "fmu_fallback": True, "fmu_param": ["fault=1", "at=2"]}
    readings(sensors(**words), paper, drive(4))
    sensors.end()
    lines = capsys.readouterr().err.splitlines()
    assert "verbose" not in lines[0]
    assert "at tick 1; restarted" in lines[0]
    assert lines[1].endswith("logs warning: verbose")
    readings(sensors(light_fmu=str(odd), fmu_log=True), paper, drive(1))
    sensors.end()
    assert "logs warning: verbose" in capsys.readouterr().err


@VERSIONS
def test_why_it_cannot_be_instantiated_is_told_though_it_logs_only_on_request(sensors, tmp_path: Path, version):
    said = "if (logging) " + (SAYS[version] % ("Error", '"no license"')).removeprefix("if (m) begin(m); ")
    odd = altered(tmp_path / "odd.fmu", "lag", version, {"if (m) begin(m);": f"{said} return NULL;"})
    with pytest.raises(UserError, match=r"odd.fmu: cannot be instantiated \(no license\)"):
        sensors(light_fmu=str(odd)).try_out()


def test_what_an_fmu_says_is_bounded(paper: Arena, sensors, tmp_path: Path, capsys):
    flood = 'for (int k = 0; k < 20000; k++) printf("line %d of %g\\n", k, m->state);'
    code = {
        "y = u;\n    steps": f"{flood} y = u;\n    steps",
        "#include <math.h>": "#include <math.h>\n#include <stdio.h>",
    }
    odd = altered(tmp_path / "odd.fmu", "faulty", 3, code)
    readings(sensors(light_fmu=str(odd), fmu_map=["raw=u", "reading=y"], fmu_param=["at=99"]), paper, drive(5))
    sensors.end()
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == MAX_LINES + 1
    assert lines[0].endswith("prints: line 0 of 0")
    assert lines[-1].endswith("has more output, which is not shown (--fmu-log shows more)")


def test_a_line_is_bounded_and_printable():
    assert one_line(b"\x00\xff\xfe a\r\n\tb \x1b[31m") == "\ufffd\ufffd\ufffd a b \ufffd[31m"
    long = one_line(b"begin" + b"x" * 5_000_000 + b"the end")
    assert len(long) <= MAX_LINE_CHARACTERS + 3
    assert long.startswith("begin")
    assert long.endswith("the end")


def test_a_crash_is_told_with_the_last_words(paper: Arena, sensors, tmp_path: Path, capsys):
    code = {
        "*(volatile int *)0 = 1;": 'fprintf(stderr, "no calibration\\n"); abort();',
        "#include <math.h>": "#include <math.h>\n#include <stdio.h>",
    }
    odd = altered(tmp_path / "odd.fmu", "faulty", 3, code)
    words = {"fmu_param": ["fault=5", "at=1"], "fmu_fallback": True}
    readings(sensors(light_fmu=str(odd), **words), paper, drive(1))
    assert "crashed with SIGABRT; its last output: no calibration at tick 0" in capsys.readouterr().err


def test_an_fmu_that_is_slower_than_real_time_is_named(paper: Arena, sensors, tmp_path: Path, capsys):
    code = {
        "double follow": "usleep(60000); double follow",
        "#include <math.h>": "#include <math.h>\n#include <unistd.h>",
    }
    odd = altered(tmp_path / "odd.fmu", "lag", 3, code)
    fast = msgspec.structs.replace(
        paper, motion=msgspec.structs.replace(paper.motion, control_period=0.1, physics_step=0.1)
    )
    readings(sensors(light_fmu=str(odd)), fast, drive(3))
    assert capsys.readouterr().err.count("in real time a tick lasts 0.1 s") == 1


# -- helpers


def sleeping(seconds: str) -> list[int]:
    return [one.pid for one in psutil.process_iter(["cmdline"]) if one.info["cmdline"] == ["sleep", seconds]]


@pytest.mark.parametrize("end", ["well", "crash", "endless", "killed"])
def test_the_helpers_of_an_fmu_end_with_it(paper: Arena, sensors, tmp_path: Path, end):
    seconds = f"{os.getpid()}.{len(end)}"
    code = {
        "if (m) begin(m);": f'if (!fork()) execlp("sleep", "sleep", "{seconds}", NULL); if (m) begin(m);',
        '#include <stdlib.h>\n#include <string.h>\n\n#include "fmi2': "#include <unistd.h>\n#include <stdlib.h>\n"
        '#include <string.h>\n\n#include "fmi2',
    }
    odd = altered(tmp_path / "odd.fmu", "faulty", 2, code)
    fault = {"crash": 5, "endless": 6}.get(end, 0)
    make = sensors(light_fmu=str(odd), fmu_param=[f"fault={fault}", "at=2"], fmu_timeout=0.3, fmu_fallback=True)
    model = make(paper, Scene(paper)).light
    model(PastMoment(0, 0, 5, 5, 0))
    host = model._stepped._host
    assert isinstance(host, Host)
    begun_by = time.monotonic() + 5
    while len(sleeping(seconds)) < 2 and time.monotonic() < begun_by:
        pass  # a helper has its name only once it has replaced the process that forked
    assert len(sleeping(seconds)) == 2, "one for each instance"
    if end == "killed":
        psutil.Process(host.pid).kill()
    elif fault:
        model(PastMoment(1, 0, 5, 5, 0))
        assert model._stepped.failed
    make.close()
    assert sleeping(seconds) == []


# -- sources with a prefix


def prefixed(version: Version, target: Path) -> Path:
    """The sources of an FMU whose functions are called lag_fmi3DoStep, unless the standard's macro says otherwise."""
    source = target.with_suffix(".plain")
    build(EXAMPLES["lag"], version, source, sources_only=True)
    include, define = f'#include "fmi{version}Functions.h"', f"#define FMI{version}_FUNCTION_PREFIX lag_\n"
    own = f"""#include_next "fmi2Functions.h"
#if !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
{"".join(f"#define {name} lag_{name}{chr(10)}" for name in ("fmi2DoStep", "fmi2Instantiate", "fmi2GetReal"))}
#endif
"""

    def edit(name: str, data: bytes) -> tuple[str, bytes]:
        return name, data.replace(include.encode(), (define + include).encode()) if name.endswith(".c") else data

    edited(source, target, edit)
    if version == 2:  # the headers of the standard are younger than those of fmpy
        with zipfile.ZipFile(target, "a") as archive:
            archive.writestr("sources/fmi2Functions.h", own)
    return target


@VERSIONS
def test_sources_with_a_prefix_are_compiled_without_it(paper: Arena, sensors, tmp_path: Path, version):
    make = sensors(light_fmu=str(prefixed(version, tmp_path / "p.fmu")), allow_compile=True)
    assert readings(make, paper, drive(1))


def test_a_library_with_a_prefix_is_used_by_it(fmu: Built, paper: Arena, sensors, tmp_path: Path):
    include = '#include "fmi3Functions.h"'
    odd = altered(tmp_path / "odd.fmu", "lag", 3, {include: f"#define FMI3_FUNCTION_PREFIX lag_\n{include}"})
    good = sensors(light_fmu=str(fmu("lag", 3)))
    assert readings(sensors(light_fmu=str(odd)), paper, drive(20)) == readings(good, paper, drive(20))


# -- types, names, start values


SINGLES = {
    "NO_TYPE(Float32)": """
fmi3Status fmi3GetFloat32(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float32 v[], size_t count) {
    for (size_t k = 0; k < n; k++) v[k] = (float)((Model *)i)->v[r[k]];
    return n == count ? fmi3OK : fmi3Error;
}
fmi3Status fmi3SetFloat32(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float32 v[], size_t count) {
    for (size_t k = 0; k < n; k++) ((Model *)i)->v[r[k]] = v[k];
    return n == count ? fmi3OK : fmi3Error;
}
"""
}


def test_single_precision_beside_double(fmu: Built, paper: Arena, sensors, tmp_path: Path):
    description = {f'<Float64 name="{name}"': f'<Float32 name="{name}"' for name in ("brightness", "reading")}
    odd = altered(tmp_path / "odd.fmu", "light", 3, SINGLES, description)
    good = readings(sensors(light_fmu=str(fmu("light", 3))), paper, drive(20))
    assert np.allclose(readings(sensors(light_fmu=str(odd)), paper, drive(20)), good, atol=1e-6)


STRUCTURAL = {
    "NEVER(fmi3EnterConfigurationMode)": "static int configuring; static fmi3UInt64 beams = 4;\n"
    "fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) { configuring = 1; return fmi3OK; }",
    "NEVER(fmi3ExitConfigurationMode)": "fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) "
    "{ configuring = 0; return beams == 16 ? fmi3OK : fmi3Error; }",
    "NO_TYPE(UInt64)": "static int configuring; static fmi3UInt64 beams;\n"
    "fmi3Status fmi3GetUInt64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3UInt64 v[], size_t c) "
    "{ return fmi3Error; }\n"
    "fmi3Status fmi3SetUInt64(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3UInt64 v[], size_t c) "
    "{ beams = v[0]; return configuring ? fmi3OK : fmi3Error; }",
}
BEAMS = {
    '<Dimension start="16" />': '<Dimension valueReference="60" />',
    "<ModelVariables>": '<ModelVariables><UInt64 name="beams.number" valueReference="60" '
    'causality="structuralParameter" variability="fixed" start="4"/>',
}


def test_a_structural_parameter_sets_the_size_of_arrays(fmu: Built, paper: Arena, sensors, tmp_path: Path):
    odd = altered(tmp_path / "odd.fmu", "sonar", 3, STRUCTURAL, BEAMS)
    with pytest.raises(UserError, match="range has 4 values; it must have 1 or 16"):
        sensors(sonar_fmu=str(odd))
    make, good = sensors(sonar_fmu=str(odd), fmu_param=["beams.number=16"]), sensors(sonar_fmu=str(fmu("sonar", 3)))
    assert readings(make, paper, drive(30), "sonar") == readings(good, paper, drive(30), "sonar")
    with pytest.raises(UserError, match="is of type UInt64, which cannot hold this value"):
        sensors(sonar_fmu=str(odd), fmu_param=["beams.number=-1"])


def test_inputs_that_are_not_connected_and_arrays_get_start_values(fmu: Built, paper: Arena, sensors, tmp_path: Path):
    code = {"y = m->state +=": "y = tau +", "y = m->state = u;": "y = u;", "follow * (u - m->state)": "0"}
    ways = {'name="tau" valueReference="3" causality="parameter"': 'name="tau" valueReference="3" causality="input"'}
    ways |= {'variability="tunable"': 'variability="continuous"', 'unit="s"': ""}
    odd = altered(tmp_path / "odd.fmu", "lag", 3, code, ways)
    with pytest.raises(UserError, match="it is not clear which input to use"):
        sensors(light_fmu=str(odd))
    for options in ({"fmu_param": ["tau=0.25"]}, {"fmu_param": ["tau=0.25"], "fmu_map": ["raw=u"]}):
        assert readings(sensors(light_fmu=str(odd), **options), paper, drive(20)) == [[0.25, 0.25]] * 20
    with pytest.raises(UserError, match="tau gets our raw, so --fmu-param cannot set it"):
        sensors(light_fmu=str(odd), fmu_param=["tau=0.25"], fmu_map=["raw=tau"])
    end = 'unit="m" variability="tunable"'
    sizes = {f'min="1e-06" {end} />': f'{end}><Dimension start="2"/></Float64>'}
    array = read(str(altered(tmp_path / "array.fmu", "sonar", 3, {}, sizes)))
    assert start_value(array, "resolution", "0.1, 0.2").values == [0.1, 0.2]
    assert start_value(array, "resolution", "0.1").values == [0.1, 0.1]
    with pytest.raises(UserError, match="resolution has 2 values; give 2, or one for all"):
        start_value(array, "resolution", "1 2 3")


PARAMETERS = """<ModelVariables>
<Int8 name="small" valueReference="70" causality="parameter" variability="fixed" start="0"/>
<UInt16 name="count" valueReference="71" causality="parameter" variability="fixed" start="0"/>
<Float32 name="single" valueReference="72" causality="parameter" variability="fixed" start="0"/>
<Boolean name="flag" valueReference="73" causality="parameter" variability="fixed" start="false"/>
<String name="path" valueReference="74" causality="parameter" variability="fixed"><Start value=""/></String>
<Enumeration name="mode" valueReference="75" causality="parameter" variability="fixed" start="1" declaredType="Modes"/>
<Float64 name="light.gain" valueReference="76" causality="parameter" variability="fixed" start="1"/>
<Float64 name="a=b" valueReference="77" causality="parameter" variability="fixed" start="1"/>
<Float64 name="sensor.der(x)[1,2]" valueReference="78" causality="parameter" variability="fixed" start="1"/>
"""
MODES = '<TypeDefinitions><EnumerationType name="Modes"><Item name="off" value="1"/><Item name="on" value="4"/>'
MODES += "</EnumerationType></TypeDefinitions>"


@pytest.fixture(scope="module")
def typed(fmu: Built, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU with a parameter of every kind."""
    folder = tmp_path_factory.mktemp("typed")
    file = described(fmu("lag", 3), folder / "a.fmu", "<ModelVariables>", MODES + PARAMETERS)
    return described(file, folder / "typed.fmu", ' variableNamingConvention="structured"', "")


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("small", "-128", -128), ("small", "128", None), ("small", "1.5", None), ("count", "65535", 65535),
        ("count", "-1", None), ("single", "1e38", 1e38), ("single", "1e39", None), ("tau", "nan", None),
        ("tau", "inf", None), ("tau", "1e999", None), ("tau", "", None), ("flag", "TRUE", True), ("flag", "2", None),
        ("path", "a=b.c", "a=b.c"), ("path", "\udcff", None), ("mode", "on", 4), ("mode", "4", 4), ("mode", "2", None),
        ("mode", "none", None), ("time", "1", None), ("u", "0.5", 0.5), ("y", "0.5", None),
    ],
)  # fmt: skip
def test_a_value_that_does_not_fit_its_variable_is_refused(typed: Path, name, text, value):
    if value is None:
        with pytest.raises(UserError):
            start_value(read(str(typed)), name, text)
    else:
        assert start_value(read(str(typed)), name, text).values == [value]


def test_names_with_dots_and_equals_signs(typed: Path, fmu: Built, sensors):
    words = ["light.gain=2", "a=b=3", "sensor.der(x)[1,2]=4", "path=x=y"]

    def given(make: FmuSensors) -> list[tuple[int, list]]:
        return [(one.reference, one.values) for one in make._wired["light"].wiring.parameters]

    expected = [(76, [2.0]), (77, [3.0]), (78, [4.0]), (74, ["x=y"])]
    assert given(sensors(light_fmu=str(typed), fmu_param=words)) == expected
    assert given(sensors(light_fmu=str(typed), fmu_param=[f"light.{word}" for word in words])) == expected
    both = sensors(light_fmu=str(typed), sonar_fmu=str(fmu("sonar", 3)), fmu_param=[f"light.{word}" for word in words])
    assert given(both) == expected
    with pytest.raises(UserError, match="there is no --sonar-fmu"):
        sensors(light_fmu=str(typed), fmu_param=["sonar.gain=1"])
    with pytest.raises(UserError, match="has no parameter 'b'; its parameters are small, count"):
        sensors(light_fmu=str(typed), fmu_param=["b=1=2"])


def test_connections_to_names_with_dots_and_equals_signs(fmu: Built, tmp_path: Path, sensors, paper: Arena):
    odd = described(fmu("lag", 2), tmp_path / "a.fmu", 'name="u"', 'name="body.in=1"')
    odd = described(odd, tmp_path / "b.fmu", 'name="y"', 'name="body.out"')
    odd = described(odd, tmp_path / "c.fmu", ' variableNamingConvention="structured"', "")
    words = ["raw=body.in=1", "light.reading=body.out"]
    found = readings(sensors(light_fmu=str(odd), fmu_map=words), paper, drive(20))
    assert found == readings(sensors(light_fmu=str(fmu("lag", 2))), paper, drive(20))


# -- descriptions and archives


def test_an_invalid_description_is_used_on_request(fmu: Built, tmp_path: Path, sensors, paper: Arena, capsys):
    odd = described(fmu("lag", 2), tmp_path / "a.fmu", 'generationTool="phototaxis"', 'generatedBy="phototaxis"')
    with pytest.raises(UserError, match=r"is not valid: .*generatedBy.*; to use it anyway, add --allow-invalid"):
        sensors(light_fmu=str(odd))
    found = readings(sensors(light_fmu=str(odd), allow_invalid=True), paper, drive(20))
    assert found == readings(sensors(light_fmu=str(fmu("lag", 2))), paper, drive(20))
    assert "is not valid" in capsys.readouterr().err
    broken = described(
        fmu("lag", 2), tmp_path / "b.fmu", "<ModelVariables>", '<ModelVariables wrong="1"><What name="x"/>'
    )
    with pytest.raises(UserError, match="cannot be used"):
        sensors(light_fmu=str(broken), allow_invalid=True)
    variable = 'canHandleVariableCommunicationStepSize="true"'
    for source, number, word in (
        (fmu("lag", 2), 'min="0.0"', 'min="nought"'),
        (fmu("lag", 3), variable, f'fixedInternalStepSize="nought" {variable}'),
    ):
        words = described(source, tmp_path / "c.fmu", number, word)
        with pytest.raises(UserError, match="cannot be used: could not convert string to float: 'nought'"):
            sensors(light_fmu=str(words), allow_invalid=True)


def test_the_true_cause_of_a_file_that_cannot_be_used(fmu: Built, tmp_path: Path):
    def backslashes(name: str, data: bytes) -> tuple[str, bytes]:
        return (name.replace("/", "\\"), data) if name.startswith("binaries") else (name, data)

    def inside(name: str, data: bytes) -> tuple[str, bytes]:
        return f"lag/{name}", data

    def latin(name: str, data: bytes) -> tuple[str, bytes]:
        return name, data.replace(b"slow sensor", b"tr\xe4ge") if name == "modelDescription.xml" else data

    def refused(file: Path, line: str) -> None:
        with pytest.raises(UserError, match=line) as caught:
            connect(read(str(file)), SUITES["light"], {}, {})
        assert "\n" not in str(caught.value)

    source, file = fmu("lag", 3), tmp_path / "odd.fmu"
    refused(edited(source, file, backslashes), r"wrongly packed: binaries\\x86_64-linux\\lag.so has backslashes")
    refused(edited(source, file, inside), "it has no modelDescription.xml; lag/modelDescription.xml has the wrong")
    refused(edited(source, file, latin), "its modelDescription.xml is not XML: .*bytes")
    with zipfile.ZipFile(edited(source, file, lambda name, data: (name, data)), "a") as archive:
        link = zipfile.ZipInfo("resources/table.csv")
        link.external_attr = 0o120777 << 16
        archive.writestr(link, "/etc/passwd")
    refused(file, "wrongly packed: resources/table.csv is a symbolic link")
    other = described(source, file, "CoSimulation", "ScheduledExecution")
    other = described(other, tmp_path / "b.fmu", ' canHandleVariableCommunicationStepSize="true"', "")
    refused(other, "supports only Scheduled Execution; it must support Co-Simulation")
    file.write_bytes(bytes(range(256)) * 20)
    refused(file, "not an FMU: it is not a zip archive")
