"""What a person is told: what was expected, in plain words, with an example, and what may have been meant."""

import os
import subprocess
import sys
from typing import Annotated, Literal

import msgspec
import pytest
from msgspec import Meta
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import convert, flags, parse, peek
from phototaxis.runtime.phrases import known, plain
from phototaxis_lab.progress import Progress
from phototaxis_lab.running import SEEDS


class Options(msgspec.Struct):
    """Some of every kind."""

    verb: Literal["pause", "resume"] = "pause"
    epochs: Annotated[int, Meta(ge=1)] = 3000
    rate: Annotated[float, Meta(gt=0, le=1)] = 0.5
    free: float = 0.0
    name: Annotated[str, Meta(pattern="^[a-z]*$", max_length=9, description="small letters")] = "robot"
    code: Annotated[str, Meta(pattern="^[0-9]*$")] = "12"
    seeds: SEEDS = "0:20"
    days: Annotated[float, Meta(ge=0, examples=[30])] | None = None
    pair: Annotated[str, Meta(pattern="^[a-z]*$", description="small letters")] | None = None
    slow: bool = False
    shown: bool = True


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("resum", "VERB resum: no such verb; did you mean resume? there are: pause, resume"),
        ("juggle", "VERB juggle: no such verb; there are: pause, resume"),
        ("--epochs 3,000", "--epochs 3,000: expected a whole number, as in 3000"),
        ("--epochs 0", "--epochs 0: expected a whole number of at least 1, as in 3000"),
        ("--rate much", "--rate much: expected a number, as in 0.5"),
        ("--rate 2", "--rate 2: expected a number of at most 1.0, as in 0.5"),
        ("--rate nan", "--rate nan: expected a number above 0.0, as in 0.5"),
        ("--free nan", "--free nan: expected a finite number, as in 0.0"),
        ("--free inf", "--free inf: expected a finite number, as in 0.0"),
        ("--days few", "--days few: expected a number, as in 30"),
        ("--pair a/b", "--pair a/b: expected small letters"),
        ("--name a/b", "--name a/b: expected small letters, as in robot"),
        ("--name abcdefghij", "--name abcdefghij: expected a text of at most 9 characters, as in robot"),
        ("--code a", "--code a: expected a text of another form, as in 12"),
        ("--seeds 20", "--seeds 20: expected A:B, the seeds from A to B − 1, as in 0:20"),
        ("--epoch 3", "no option --epoch; did you mean --epochs? (see prog --help)"),
        ("--zebra 3", "no option --zebra (see prog --help)"),
        ("-z", "no option -z (see prog --help)"),
        ("pause now", "'now' is one word too many (see prog --help)"),
        ("--slow=3", "--slow takes no value, got '3' (see prog --help)"),
    ],
)
def test_what_does_not_fit_is_told_with_an_example(words: str, line: str):
    with pytest.raises(UserError) as caught:
        parse(Options, words.split(), "prog", "", positional=["verb"])
    assert str(caught.value) == line


def test_an_option_without_its_value_is_left_to_whoever_reads_all():
    assert peek(["--learner"], "--learner", "qtable") == peek([], "--learner", "qtable") == "qtable"
    assert peek(["--learner=ann", "--learner", "mirror"], "--learner", "qtable") == "mirror"


def test_what_is_given_to_a_child_is_read_by_it_as_it_was():
    given = Options(epochs=7, slow=True, shown=False)
    assert parse(Options, flags(given), "prog", "") == given
    assert parse(Options, flags(Options()), "prog", "") == Options()


def test_what_a_struct_itself_refuses_is_one_line():
    class Ordered(msgspec.Struct):
        low: int = 0
        high: int = 1

        def __post_init__(self) -> None:
            if self.low > self.high:
                raise ValueError("low is above high")

    with pytest.raises(UserError, match=r"^low is above high$"):
        convert(Ordered, {"low": "3"})


@pytest.mark.parametrize(
    ("value", "kind", "words"),
    [
        ("x", int | None, "expected a whole number, got a text"),
        ([1], tuple[int, int], "expected a list of 2 entries, got 1"),
        ([], Annotated[list[int], Meta(min_length=3)], "expected a list of at least 3 entries"),
        ({"a": [1]}, dict[str, list[str]], "expected a text, got a whole number - at `$[...][0]`"),
        (["b"], list[Annotated[str, Meta(pattern="^it's `a`$")]], "expected a text of another form - at `$[0]`"),
        ("red", Literal["blue"], "'red' is not one of the choices"),
    ],
)
def test_no_type_and_no_regular_expression_is_named(value: object, kind: object, words: str):
    with pytest.raises(msgspec.ValidationError) as caught:
        msgspec.convert(value, kind)
    assert plain(str(caught.value)) == words


def test_the_nearest_name_is_told_whatever_its_case():
    assert known("MIRORR", ["ann", "mirror"]) == "did you mean mirror? there are: ann, mirror"
    assert known("zebra", ["ann", "mirror"]) == "there are: ann, mirror"
    assert known("zebra", []) == "there are: none"


def test_progress_says_what_is_left():
    progress = Progress(3000, "epochs")
    progress.add(1000)
    assert progress.line(60.0) == "1,000 of 3,000 epochs, about 02:00 left"


def test_progress_is_a_bar_with_an_estimate_in_any_terminal():
    ours, theirs = os.openpty()
    script = (
        "import phototaxis_lab.progress as p; p.QUIET_S = 0\nwith p.Progress(2, 'epochs') as bar: bar.add(); bar.add()"
    )
    done = subprocess.run([sys.executable, "-c", script], stderr=theirs, check=False)
    os.close(theirs)
    shown = os.read(ours, 10_000)
    os.close(ours)
    assert done.returncode == 0
    assert b"2.00/2.00 [00:00<00:00," in shown


SAYS = "import sys; import phototaxis.runtime.errors as e; sys.exit(e.one_line(lambda: print('±, …, \\udcff') or 0))"


@pytest.mark.parametrize("redirection", ["", ">&-", "2>&-", ">&- 2>&- <&-"])
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_whatever_the_standard_streams_are_a_command_ends_as_it_should(redirection: str, encoding: str):
    words = ["sh", "-c", f'"$0" -c "$1" {redirection}', sys.executable, SAYS]
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    done = subprocess.run(words, env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(
        {"ascii": b"?, ?, ", "latin-1": b"\xb1, ?", "utf-8": "±, …, ?".encode()}[encoding]
    ) or (">&-" in redirection)


def test_a_closed_stream_gives_its_number_to_nobody():
    opens = "import os; print(os.open('/dev/zero', os.O_RDONLY) > 2)"
    words = [
        "sh",
        "-c",
        '"$0" -c "$1" 2>&- <&-',
        sys.executable,
        f"import phototaxis.runtime.streams as s; s.prepare(); {opens}",
    ]
    done = subprocess.run(words, capture_output=True, check=False)
    assert done.stdout == b"True\n"
