"""What a user types wrong is one line on every command: what, where, what to do; exit code 2."""

import pytest
from support import phototaxis

PORT = "an endpoint is like tcp/127.0.0.1:7447"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("juggle", "no command 'juggle'; there are: demo, up"),
        ("sim --seed -1", "--seed -1: expected a whole number of at least 0"),
        ("sim --arena folder", "no arena 'folder'"),
        ("sim --arena garbage", "garbage: not TOML"),
        ("sim --arena binary", "binary: not a text file in UTF-8"),
        ("sim --listen 127.0.0.1:7447", PORT),
        ("sim --robots 5000", "--robots 5000: expected a whole number of at most 4096"),
        ("sensors --light-fmu folder", "folder: not an FMU"),
        ("sensors --connect tcp/", PORT),
        ("agent --agent-seed -1", "--agent-seed -1: expected a whole number of at least 0"),
        ("agent --policy garbage.zip --trust", "garbage.zip: not a policy that Stable-Baselines3 has saved"),
        ("up --seed -1", "--seed -1: expected a whole number of at least 0"),
        ("up --web-port -2", "--web-port -2: expected a whole number of at least -1"),
        ("up --epochs 10 --out garbage", "--out garbage: "),
        (
            "up --epochs 10 --arena papr",
            "sim: no arena 'papr': neither a file nor one that is shipped; did you mean paper?",
        ),
        (
            "up --learner mirror --learning-rate 0.1",
            "no option --learning-rate (see phototaxis agent --learner mirror --help)",
        ),
        ("up --resume nothing.npz", "error: nothing.npz: no such checkpoint"),
        ("swap mirror --checkpoint c.npz", "--checkpoint is for an agent that is started alone"),
        ("agent --worlds a/b", "--worlds a/b: expected names with commas between them, each up to 40 letters"),
        ("train --learner", "--learner: expected one argument"),
        ("demo --lerner mirror", "no option --lerner; did you mean --learner?"),
        ("agent --lerner mirror", "no option --lerner; did you mean --learner?"),
        ("train --seed -1", "--seed -1: expected a whole number of at least 0"),
        ("train --seed 99999999999999999999", "--seed 99999999999999999999: expected a whole number of at most"),
        ("train --checkpoint nowhere/c.npz", "there is no folder nowhere"),
        ("evaluate binary", "binary: not a checkpoint, or truncated"),
        ("evaluate folder", "folder: "),
        ("evaluate binary --seed -1", "--seed -1: expected a whole number of at least 0"),
        ("experiment --jobs 0 --out x", "--jobs 0: at least one process"),
        ("experiment --seeds 5:1 --out x", "--seeds 5:1: no seed from 5 to 1"),
        ("experiment --learners magic --out x", "no learner 'magic'"),
        ("experiment --out garbage", "garbage: "),
        ("reproduce --out garbage", "--out garbage: "),
        ("fmu juggle", "no command 'fmu juggle'"),
        ("fmu build juggler", "no example 'juggler'; there are: light"),
        ("fmu build light --sources-only --output folder", "folder: Is a directory"),
        ("fmu info binary", "binary: not an FMU"),
        ("view nothing", "no recording of a run 'nothing'"),
        ("status --connect nowhere", PORT),
        ("status --name a/b", "--name a/b: expected up to 40 letters, digits, '_', '.' and '-'"),
        ("status --zenoh-config garbage", "garbage: not a Zenoh configuration"),
        ("control resum", "VERB resum: no such verb; did you mean resume? there are: pause, resume"),
        ("control juggle", "no such verb; there are: pause, resume"),
        ("control begin --seed -1", "--seed -1: expected a whole number of at least 0"),
        ("health juggler", "no such role; there are: router, sim"),
        ("check nothing", "there are: agent, rights, wire"),
        ("router", "a router needs --listen ENDPOINT"),
        ("router --listen localhost", PORT),
    ],
)
def test_a_mistake_is_one_line(tmp_path, monkeypatch, words, line):
    (tmp_path / "folder").mkdir()
    for name in ("garbage", "garbage.zip"):
        (tmp_path / name).write_text("garbage")
    (tmp_path / "binary").write_bytes(bytes(range(128, 256)))
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    done = phototaxis(*words.split())
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("phototaxis: error: ")
    assert done.stderr.count("\n") == 1
    assert line in done.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_a_run_that_never_began_leaves_no_folder(up, tmp_path):
    launcher = up("--light-fmu", "nothing.fmu")
    assert launcher.end() == 2
    assert launcher.stderr.splitlines()[-1] == "phototaxis: error: sensors: nothing.fmu: there is no such file"
    assert not (tmp_path / "runs").exists()
