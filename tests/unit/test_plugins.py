"""A learner of somebody else that cannot be used is one line that names it, and takes no other with it."""

import re
import sys
from pathlib import Path

import pytest
from phototaxis.runtime.errors import UserError
from phototaxis_agent.__main__ import read
from phototaxis_agent.setup import make_setup
from phototaxis_lab import experiment, train
from phototaxis_launcher.options import parse
from plugins import HEAD, install

LINE = HEAD.count("\n") + 1
"""Of the first line of a plug-in's own code."""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A folder on the path."""
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.endswith("_plugin")]:
        del sys.modules[name]


def options(field: str) -> str:
    return f"class Odd(Fine):\n    class Options(msgspec.Struct, frozen=True):\n        {field}\n"


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("import nothing_of_that_name", rf"ModuleNotFoundError: No .*plugin.py, line {LINE}\)"),
        ("raise SystemExit", rf"SystemExit \(.*plugin.py, line {LINE}\)"),
        ("1 / 0", rf"ZeroDivisionError: division by zero \(.*plugin.py, line {LINE}\)"),
        ("if", rf"SyntaxError: .*plugin.py, line {LINE}\)"),
        ("", "has no attribute 'Odd'"),
        ("Odd = 3", "is not a subclass of phototaxis_agent.learner.Learner"),
        ("class Odd:\n    pass", "is not a subclass of phototaxis_agent.learner.Learner"),
        ("class Odd(Learner):\n    pass", "needs Options, a msgspec.Struct"),
        ("class Odd(Fine):\n    class Options:\n        rate = 1", "needs Options, a msgspec.Struct"),
        ("class Odd(Learner):\n    Options = Fine.Options", "has no method values"),
        (options("epochs: int = 3"), "calls a hyperparameter 'epochs', which is an option of Phototaxis itself"),
        (options("percept: str = ''"), "calls a hyperparameter 'percept'"),
        (options("help: str = ''"), "calls a hyperparameter 'help'"),
        (options("rate: float"), "--rate is missing"),
        (
            "class Odd(Fine):\n    def __init__(self, options, percept, rng):\n        self.x = {}['key']",
            rf"its constructor raised KeyError: 'key' \(.*plugin.py, line {LINE + 2}\)",
        ),
        ("class Odd(Fine):\n    def __init__(self):\n        pass", "its constructor raised TypeError: .*argument"),
    ],
)
def test_an_odd_learner_is_named_in_one_line(site: Path, code: str, message: str):
    install(site, "odd", code, "Odd")
    for command in (lambda: train.main(["--learner", "odd", "--epochs", "10"]), lambda: parse(["--learner", "odd"])):
        with pytest.raises(UserError, match=message) as caught:
            command()
        assert "\n" not in str(caught.value)
    assert read(["--learner", "qtable"])[1].learner == "qtable"


def test_a_hyperparameter_that_only_one_command_has_as_an_option_is_refused_there(site: Path):
    install(site, "odd", options("swap: int = 3"), "Odd")
    assert read(["--learner", "odd", "--swap", "4"])[1].hyperparameters.swap == 4
    with pytest.raises(UserError, match="calls a hyperparameter 'swap'"):
        parse(["--learner", "odd"])


def test_what_is_true_by_default_can_be_switched_off(site: Path):
    install(site, "fine", "")
    assert read(["--learner", "fine"])[1].hyperparameters.centred
    assert not read(["--learner", "fine", "--no-centred"])[1].hyperparameters.centred


def test_a_broken_learner_keeps_no_help_from_being_shown(site: Path, capsys: pytest.CaptureFixture[str]):
    install(site, "odd", "import nothing_of_that_name", "Odd")
    for command in (train.main, experiment.main):
        with pytest.raises(SystemExit):
            command(["--help"])
        assert "--epochs" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--lerner ann", "no option --lerner; did you mean --learner?"),
        ("--epoch 10", "no option --epoch; did you mean --epochs?"),
        (
            "--learner mirror --learning-rate 0.1",
            "no option --learning-rate (see phototaxis agent --learner mirror --help)",
        ),
        ("--learner Mirror", "no learner 'Mirror'; did you mean mirror? there are: ann, "),
        ("--swap 10:mirorr", "no learner 'mirorr'; did you mean mirror?"),
        ("--gamma 0,5", "--gamma 0,5: expected a number, as in 0.75"),
        ("--learner mirror --percept continuous", "--percept continuous: this learner keeps a table"),
    ],
)
def test_an_agents_options_are_checked_before_anything_is_started(words: str, message: str):
    with pytest.raises(UserError, match=re.escape(message)):
        parse(words.split())


def test_options_by_name_are_told_by_name():
    with pytest.raises(UserError, match=r"^gamma 2: expected a number below 1.0, as in 0.75$"):
        make_setup(gamma=2)
