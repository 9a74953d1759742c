"""What README, docs and examples show is what the programs take: command lines, Python, entry points, verbs."""

import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from phototaxis.runtime import options
from phototaxis_lab import train
from phototaxis_launcher import cli, swap
from phototaxis_launcher.options import parse

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SCRIPTS = sorted((ROOT / "examples").rglob("*.py"))
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(page: Path, language: str) -> list[str]:
    """The code blocks of a page in one language."""
    return [text for kind, text in BLOCK.findall(page.read_text("utf-8")) if kind == language]


def shell() -> Iterator[tuple[str, str]]:
    """Every line of shell that the pages and the examples show, with the file that shows it."""
    for page in PAGES:
        for block in blocks(page, "sh"):
            yield from ((page.name, line) for line in block.replace("\\\n", " ").splitlines())
    for script in SCRIPTS:
        head = script.read_text("utf-8").split('"""')[1]
        yield from ((script.name, line) for line in re.findall("^ *((?:phototaxis|python|pip) .*)", head, re.MULTILINE))


def commands() -> list[Any]:
    """The words after `phototaxis` of every command line."""
    found = []
    for file, line in shell():
        lexer = shlex.shlex(line, posix=True, punctuation_chars="&;|")
        lexer.whitespace_split = True
        words: list[str] = []
        for word in [*lexer, ";"]:
            if set(word) <= set("&;|"):
                while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
                    del words[0]
                if words[:1] == ["phototaxis"]:
                    found.append(pytest.param(words[1:], id=f"{file}: {' '.join(words[1:])}"))
                words = []
            else:
                words.append(word)
    return found


class Read(Exception):
    """The command line has been read."""


def plug_in(folder: Path, point: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let entry points be found as if a distribution with this code were installed."""
    (folder / "mine-1.dist-info").mkdir()
    (folder / "mine-1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1\n")
    (folder / "mine-1.dist-info" / "entry_points.txt").write_text(point)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "double_q", raising=False)


@pytest.fixture
def reading(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Commands end as soon as they have read their options; the learner of the examples is installed."""
    shutil.copy(ROOT / "examples" / "double_q" / "double_q.py", tmp_path)
    plug_in(tmp_path, "[phototaxis.learners]\ndouble-q = double_q:DoubleQ\n", monkeypatch)
    read = options.parse_groups

    def parse_groups(*given: Any, **more: Any) -> Any:
        read(*given, **more)
        raise Read

    for module in [module for name, module in sys.modules.items() if name.startswith("phototaxis")]:
        if getattr(module, "parse_groups", None) is read:
            monkeypatch.setattr(module, "parse_groups", parse_groups)

    def ask(_: Any, request: Any) -> None:
        importlib.import_module("phototaxis_agent.__main__").read(request.words)

    monkeypatch.setattr(swap, "_ask", ask)


@pytest.mark.parametrize("words", commands())
def test_every_command_line_that_is_shown_is_understood(reading: None, words: list[str]):
    for verb in cli.VERBS.values():
        importlib.import_module(verb.target.partition(":")[0])
    with pytest.raises(Read):
        cli.dispatch(words)


def test_what_is_shown_is_found():
    assert len(commands()) > 40
    assert parse(["--learner", "mirror"])[2] == ["--learner", "mirror"]


def test_every_verb_of_make_that_is_shown_exists():
    verbs = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    shown = {word for _, line in shell() for word in re.findall(r"^make ([a-z]+)", line)}
    assert {"demo", "test"} <= shown <= verbs


def test_every_file_that_is_run_exists():
    files = {word for _, line in shell() for word in re.findall(r"python3? (\S+\.py)", line)}
    files |= {word for _, line in shell() for word in re.findall(r"pip install \./(\S+)", line)}
    assert files
    assert all((ROOT / file).exists() for file in files), files


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_that_needs_no_running_system_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    shown = {}
    for whole in blocks(page, "python"):
        text = re.sub(r"learn\([0-9_]+\)", "learn(64)", whole)  # what is learned is not the question here
        if "connect=" not in text:
            exec(compile(text, page.name, "exec"), shown)  # noqa: S102


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_an_example_that_lacks_something_says_so_in_one_line(script: Path, tmp_path: Path):
    if not script.read_text("utf-8").count("argparse"):
        environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, env=environment)
        assert done.returncode
        assert done.stderr.count("\n") == 1


def test_the_foreign_agent_says_which_router_it_lacks(tmp_path: Path):
    words = [sys.executable, ROOT / "examples" / "foreign_agent.py", "tcp/127.0.0.1:9"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 1
    line = "no router answers at tcp/127.0.0.1:9; start one with: phototaxis router --listen tcp/127.0.0.1:9\n"
    assert done.stderr == line


def test_the_learner_of_the_page_plugs_in_and_learns(tmp_path: Path, monkeypatch, capsys):
    page = ROOT / "docs" / "own-learner.md"
    (tmp_path / "double_q.py").write_text(blocks(page, "python")[0], "utf-8")
    point = blocks(page, "toml")[0].replace("project.entry-points.", "").replace('"', "")
    plug_in(tmp_path, point, monkeypatch)
    checkpoint = tmp_path / "mine.npz"
    assert (
        train.main(
            ["--learner", "double-q", "--learning-rate", "0.2", "--epochs", "200", "--checkpoint", str(checkpoint)]
        )
        == 0
    )
    assert sys.modules.pop("double_q").__file__ == str(tmp_path / "double_q.py")
    assert "200 epochs" in capsys.readouterr().out
