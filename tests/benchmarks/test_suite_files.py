"""Suites as files: the package's own and a user's by the same reader, and one line about whatever is wrong in one."""

import json
import os
import re
import signal
from pathlib import Path

import pytest

import lanekeep_benchmarks
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.plan import make_plan
from lanekeep_benchmarks.results import EPISODES
from lanekeep_benchmarks.run_record import RUN
from lanekeep_benchmarks.suites import SUITES, read_suite
from lanekeep_benchmarks.suites.reader import LARGEST_FILE, LONGEST_LINE

FOLDER = Path(lanekeep_benchmarks.__file__).parent / "suites"
HEAD = 'name = "mine"\ndescription = "two roads"\nepisodes = 2\n'
MINE = f"""{HEAD}policies = ["pd", "yin-lqr"]

[common]
max_episode_steps = 30
keywords = {{ road = "slalom", departure = "cost" }}

[[scenario]]
name = "slalom"
title = "A slalom, at $5 and $6"

[[scenario]]
name = "circle"
title = "A circle"
keywords = {{ road = "circle", lane_width = 3.9 }}
"""
ONE = '[[scenario]]\nname = "a"\ntitle = "A"\n'


@pytest.fixture
def mine(tmp_path):
    file = tmp_path / "my suite.toml"
    file.write_text(MINE)
    return file


def refusal(content, tmp_path, capsys):
    """The line that refuses to drive a file with that content; nothing is written."""
    file = tmp_path / "wrong.toml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert main(["bench", str(file), "--out", str(tmp_path / "out")]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    assert str(file) in captured.err and len(captured.err) < 3000
    assert not (tmp_path / "out").exists()
    return captured.err


def test_the_packages_own_are_called_as_their_files(capsys):
    assert list(SUITES) == sorted(file.stem for file in FOLDER.glob("*.toml"))
    assert all(read_suite(file) == SUITES[file.stem] for file in FOLDER.glob("*.toml"))
    assert main(["bench", "--help"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in SUITES)


def test_scenarios_extend_what_is_common_keyword_by_keyword(mine):
    suite = read_suite(mine)
    slalom, circle = suite.scenarios
    assert (suite.name, suite.episodes, suite.policies, suite.learned) == ("mine", 2, ("pd", "yin-lqr"), False)
    assert dict(slalom.keywords) == {"road": "slalom", "departure": "cost"}
    assert dict(circle.keywords) == {"road": "circle", "departure": "cost", "lane_width": 3.9}
    assert slalom.max_episode_steps == circle.max_episode_steps == 30


def test_the_example_of_the_readme_is_driven(tmp_path):
    text = (FOLDER.parents[1] / "README.md").read_text()
    (example,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    file = tmp_path / "my_suite.toml"
    file.write_text(example)
    plan = make_plan(str(file), ("stanley", "yin-lqr-feedforward"), None, None, 0)
    assert plan.total == 2 * 2 * plan.suite.episodes
    assert len({*plan.scenario_hash.values()}) == 2


def test_a_file_is_driven_and_resumed_and_a_changed_one_is_refused(mine, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["bench", str(mine), "--out", str(out)]) == 0
    whole = {file.name: file.read_bytes() for file in out.rglob("*.*")}
    lines = whole[EPISODES].splitlines(keepends=True)
    assert len(lines) == 2 * 2 * 2 and json.loads(whole[RUN])["policies"] == ["pd", "yin-lqr"]
    (out / EPISODES).write_bytes(b"".join(lines[:3]))
    assert main(["bench", "--resume", "--out", str(out)]) == 0
    again = {file.name: file.read_bytes() for file in out.rglob("*.*")}
    assert sorted(again.pop(EPISODES).splitlines()) == sorted(whole.pop(EPISODES).splitlines())
    assert again == whole
    capsys.readouterr()
    for change, words in (
        (("3.9", "3.8"), "scenario_hash of circle is "),
        (('name = "circle"', 'name = "ring"'), "scenario_hash of ring is None there"),
        (('"mine"', '"yours"'), "suite is 'mine' there, 'yours' wanted"),
    ):
        mine.write_text(MINE.replace(*change))
        assert main(["bench", "--resume", "--out", str(out)]) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    mine.unlink()
    assert main(["bench", "--resume", "--out", str(out)]) == 2
    assert f"suite {mine}: No such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["name is missing", "a text"]),
        (HEAD, ["scenario is missing", "a list"]),
        (HEAD + "scenario = []", ["scenario=[]", "one or more"]),
        (HEAD + "scenario = [3]", ["scenario 1: 3", "a table"]),
        (HEAD + "scenario = 3", ["scenario=3", "a list"]),
        (HEAD + "lerned = true\n" + ONE, ["'lerned' is no field (did you mean 'learned'?)", "allowed: name,"]),
        (HEAD + "learned = 1\n" + ONE, ["learned=1", "true or false"]),
        (HEAD.replace("2", "true") + ONE, ["episodes=True", "a whole number"]),
        (HEAD.replace("2", "2.0") + ONE, ["episodes=2.0", "a whole number"]),
        (HEAD.replace("2", "0") + ONE, ["episodes=0", ">= 1"]),
        (HEAD.replace("2", "9" * 400) + ONE, ["episodes=<an integer of", "<= 1000000"]),
        (HEAD.replace("mine", "../mine") + ONE, ["name='../mine'", "letters"]),
        (HEAD.replace("mine", "") + ONE, ["name=''", "letters"]),
        (HEAD.replace("mine", "m" * 65) + ONE, ["name='mmm", "1 to 64"]),
        (HEAD.replace("mine", "classical") + ONE, ["name='classical'", "the package's own"]),
        (HEAD.replace("mine", "road-a") + ONE, ["name='road-a'", "the package's own"]),
        (HEAD.replace("two roads", r"two\nroads") + ONE, ["description='two", "one line"]),
        (HEAD + "policies = []\n" + ONE, ["policies=[]", "one or more"]),
        (HEAD + "policies = [3]\n" + ONE, ["policies=[3]", "names"]),
        (HEAD + 'policies = ["pd", "pd"]\n' + ONE, ["policies must differ", "'pd'"]),
        (HEAD + 'policies = ["stanly"]\n' + ONE, ["policy 'stanly'", "did you mean 'stanley'"]),
        (HEAD + 'reference = "stanly"\n' + ONE, ["policy 'stanly'", "did you mean 'stanley'"]),
        (HEAD + 'reference = "traechtler-pd"\n' + ONE, ["reference='traechtler-pd'", "none of its policies: pd, "]),
        (HEAD + ONE + ONE.replace('"a"', '"A"'), ["names of scenarios must differ", "'A'"]),
        (HEAD + '[[scenario]]\nname = "a"', ["scenario 1: title is missing"]),
        (HEAD + ONE + 'titel = "A"', ["scenario 1: 'titel' is no field (did you mean 'title'?)"]),
        (HEAD + ONE + "told = 3", ["scenario 1: told=3", "a table"]),
        (HEAD + ONE.replace('"a"', '"a/b"'), ["scenario 1: name='a/b'"]),
        (HEAD + ONE.replace('"A"', '""'), ["scenario 1: title=''"]),
        (HEAD + ONE + 'env_id = "lanekeep/LaneKep-v0"', ["env_id='lanekeep/LaneKep-v0'", "'lanekeep/LaneKeep-v0'"]),
        (HEAD + ONE + "max_episode_steps = 0", ["max_episode_steps=0", ">= 1"]),
        (HEAD + '[common]\nname = "a"\n' + ONE, ["common.'name' is no field", "allowed: env_id, "]),
        (HEAD + ONE + "keywords.friction = inf", ["scenario 1: keywords.friction=inf", "finite"]),
        (HEAD + ONE + f"keywords.road.seed = {'9' * 400}", ["keywords.road.seed=<an integer of ", "64 bits"]),
        (HEAD + ONE + "keywords.road = 2026-01-01", ["keywords.road=datetime.date(2026, 1, 1)", "dates"]),
        (HEAD + ONE + f"keywords.a = {'[' * 20}{']' * 20}", ["scenario 1: keywords.a.0.0.", "nested deeper"]),
        (
            HEAD + ONE + "keywords.frction = 0.6",
            ["scenario a: got an unexpected keyword argument 'frction' (did you mean 'friction'?)"],
        ),
        (HEAD + ONE + "keywords.friction = -1", ["scenario a: ", "friction=-1"]),
        (HEAD + ONE + 'keywords.friction = "low"', ["scenario a: ", "friction='low'"]),
        (HEAD + ONE + 'keywords.dtype = "float32"', ["scenario a: got an unexpected keyword argument 'dtype'"]),
        (HEAD + ONE + "keywords.road.kind = 'randon'", ["scenario a: ", "'randon'", "'random'"]),
        (HEAD + ONE + "told.frction = 0.6", ["scenario a: got an unexpected keyword argument 'frction'"]),
        (HEAD + ONE + "told.sensors.yaw_rate.dropout = 0.1", ["scenario a: told=", "told has a channel yaw_rate_new"]),
        (HEAD + ONE + "told.preview = 2\nkeywords.preview = 3", ["told={'preview': 2}", "driven has a channel"]),
        (HEAD + ONE + 'metrics = ["rms_eror"]', ["scenario 1: metrics='rms_eror' is unknown"]),
        (HEAD + ONE + 'metrics = ["return", "return"]', ["scenario 1: metrics must differ: 'return' appears twice"]),
        (HEAD + ONE + "metrics = [3]", ["metrics=3 is unknown"]),
        (HEAD + ONE + 'metrics = ["lap_time"]', ["scenario a: metrics='lap_time' is not allowed"]),
        (HEAD + ONE + 'metrics = ["smallest_gap"]', ["metrics='smallest_gap' is not allowed", "tells no 'gap'"]),
        (HEAD + ONE + "options.arclength = 0.0", ["scenario a: ", "'arclength' is unknown", "arc_length"]),
        ("name = \n", ["line 1"]),
        (f"{HEAD}{ONE}{ONE}title = 3\n", ["Cannot overwrite", "line 10"]),
        (f'{HEAD}["{"a" * 900}"]\n["{"a" * 900}"]\n', ["Cannot declare", "line 5"]),
        (b"# \n\nname = '\xff'", ["line 3 is not UTF-8"]),
        (b"\0" * 40, ["line 1"]),
        (HEAD + "a = " + "[\n" * 30_000, ["nested deeper"]),
        (f"{HEAD}{'a.' * 20_000}a = 1", ["line 4 has 40005 characters", f"allowed are {LONGEST_LINE}"]),
        ("#\n" * LARGEST_FILE, [f"{2 * LARGEST_FILE} bytes", f"allowed are {LARGEST_FILE}"]),
    ],
)
def test_what_is_wrong_is_one_line_with_file_and_field(content, words, tmp_path, capsys):
    error = refusal(content, tmp_path, capsys)
    assert all(word in error for word in words), error


def test_lines_of_many_keys_take_no_time(tmp_path, capsys):
    """The worst that fits: as many lines as the file may have, each one key of as many parts as a line may have."""
    key = "a." * ((LONGEST_LINE - 10) // 2)
    lines = [f"{key}b{number}=1\n" for number in range(LARGEST_FILE // (len(key) + 6))]
    signal.alarm(20)
    try:
        assert "'a' is no field" in refusal("".join(lines), tmp_path, capsys)
    finally:
        signal.alarm(0)


def test_only_ordinary_files_are_read(tmp_path, capsys):
    (tmp_path / "folder.toml").mkdir()
    os.mkfifo(tmp_path / "pipe.toml")
    for name in ("folder.toml", "pipe.toml"):
        assert main(["bench", str(tmp_path / name)]) == 2
        assert f"suite {tmp_path / name}: it is not an ordinary file" in capsys.readouterr().err
    assert main(["bench", str(tmp_path / "none.toml")]) == 2
    assert f"suite {tmp_path / 'none.toml'}: No such file" in capsys.readouterr().err


@pytest.mark.parametrize("title", [r"$\frac$", "[/] [bold]", "a | b {} ä ▲"])
def test_titles_are_shown_as_they_are(title, mine, tmp_path):
    """What is markup to tables and formulas to pictures is text here."""
    content = MINE.replace("A circle", title.replace("\\", "\\\\"))
    mine.write_text(content.replace("max_episode_steps = 30", "max_episode_steps = 2"))
    out = tmp_path / "out"
    assert main(["bench", str(mine), "--policies", "pd", "--out", str(out)]) == 0
    assert f"## {title}\n" in (out / "summary.md").read_text()
    assert (out / "plot_episode_circle.png").read_bytes().startswith(b"\x89PNG")
