"""A user's own controllers: named as code or handed over, beside the shipped ones; no file makes them run."""

import json
import os
import re
import subprocess
import sys
from types import ModuleType

import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_benchmarks
from lanekeep_baselines import OneByOne, SteeringPolicy
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.policies import entry_of
from lanekeep_benchmarks.suites import SUITES, Suite, SuiteScenario
from lanekeep_env import DriveScenario, LaneKeepScenario

pytestmark = pytest.mark.usefixtures("unpainted")
SUITE = Suite(
    "short",
    "two short roads",
    tuple(
        SuiteScenario(road, road, {"road": road, "departure": "cost", "preview": 1}, max_episode_steps=20)
        for road in ("slalom", "circle")
    ),
    episodes=3,
)
#: `pd` as a user would write it, three times: arrays, a car alone, a bare object.
CODE = """
import numpy as np
from lanekeep_baselines import OneByOne, SteeringPolicy

class Mine(SteeringPolicy):
    name = "mine"
    reads = ("lateral_error", "heading_error")

    def command(self, at, memory, fresh):
        return -0.03 * at["lateral_error"] - 0.6 * at["heading_error"], None

class Forgets(Mine):
    def command(self, at, memory, fresh):
        return -0.03 * at["lateral_error"]

class OneNumber(Mine):
    def command(self, at, memory, fresh):
        return 0.1, None

class Car:
    def __init__(self, scenario):
        names = [channel.name for channel in scenario.channels]
        self.lateral, self.heading = names.index("lateral_error"), names.index("heading_error")
        self.largest = scenario.max_steering_angle

    def act(self, observation):
        lateral, heading = float(observation[self.lateral]), float(observation[self.heading])
        return (-0.03 * lateral - 0.6 * heading) / self.largest

def alone(scenario):
    return OneByOne(lambda: Car(scenario))

def broken(scenario):
    class Broken:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return 1 / 0
    return Broken()

def flat(scenario):
    class Flat:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.zeros(len(observation)), None
    return Flat()

def no_number(scenario):
    class NoNumber:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.full((len(observation), 1), np.nan), None
    return NoNumber()

def nothing(scenario):
    return None
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with ``mine.py``, in which commands run."""
    monkeypatch.setitem(SUITES, "short", SUITE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    (tmp_path / "mine.py").write_text(CODE)
    yield tmp_path
    sys.modules.pop("mine", None)


def lines(out):
    """Metrics by policy, in the order of the episodes."""
    found = {}
    for line in map(json.loads, (out / "episodes.jsonl").read_text().splitlines()):
        found.setdefault(line["policy"], []).append((line["scenario"], line["episode"], line["metrics"]))
    return {name: sorted(those, key=lambda one: one[:2]) for name, those in found.items()}


def test_the_same_law_gives_the_same_lines_however_it_is_named(folder):
    named = ["mine.py:Mine", "mine:Mine", "mine.py:alone", str(folder / "mine.py:Mine")]
    assert main(["bench", "short", "--policies", ",".join(["pd", *named]), "--out", "out"]) == 0
    found = lines(folder / "out")
    assert set(found) == {"pd", *named}
    assert all(found[name] == found["pd"] for name in named)
    record = json.loads((folder / "out" / "run.json").read_text())
    assert len({record["policy_sha256"][name] for name in named}) == 1


def test_python_takes_names_factories_and_objects(folder):
    import mine

    policies = ["pd", mine.Mine, mine.Mine(LaneKeepScenario(preview=1, road="slalom"))]
    with pytest.raises(ValueError, match="policies 'pd, mine, mine' are not allowed"):
        lanekeep_benchmarks.benchmark("short", policies, out=folder / "twice")
    for no_list in ("pd", {"pd": mine.Mine}):
        with pytest.raises(ValueError, match=r"policies=.* is not allowed: it must be a list"):
            lanekeep_benchmarks.benchmark("short", no_list, out=folder / "twice")
    assert not (folder / "twice").exists()
    summary = lanekeep_benchmarks.benchmark("short", ["pd", mine.Mine, mine.alone], episodes=2, out=folder / "out")
    assert [row["policy"] for row in summary["scenarios"][0]["policies"]] == ["pd", "mine", "alone"]
    found = lines(folder / "out")
    assert found["mine"] == found["alone"] == found["pd"]
    assert summary["folder"] == str(folder / "out")


def test_a_registered_controller_is_one_of_all(folder, monkeypatch):
    monkeypatch.setattr(lanekeep_baselines, "_REGISTERED", {})
    import mine

    lanekeep_baselines.register("flat", mine.flat, needs=["curvature_preview_0"])
    lanekeep_baselines.register("mine", mine.Mine)
    ahead, blind = LaneKeepScenario(preview=1), LaneKeepScenario()
    assert {"flat", "mine"} <= set(lanekeep_baselines.names(ahead))
    assert "flat" not in lanekeep_baselines.names(blind)
    assert not {"flat", "mine"} & set(lanekeep_baselines.names(DriveScenario()))
    assert isinstance(lanekeep_baselines.make("mine", blind), SteeringPolicy)
    with pytest.raises(ValueError, match="'curvature_preview_0', which the scenario does not observe"):
        lanekeep_baselines.make("flat", blind)
    for name in ("pd", "a,b", "", "mine.py:Mine"):
        with pytest.raises(ValueError, match="is not allowed"):
            lanekeep_baselines.register(name, mine.flat)
    summary = lanekeep_benchmarks.benchmark("short", ["pd", "mine"], episodes=1, out=folder / "out")
    assert [row["policy"] for row in summary["scenarios"][0]["policies"]] == ["pd", "mine"]


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        ("mine.py:Min", r"mine.py has no function or class 'Min' \(did you mean 'Mine'\?\)"),
        ("mine.py", r"lacks the factory's name; allowed: mine.py:NAME"),
        ("other.py:Mine", "other.py: No such file"),
        ("other:Mine", "there is no module 'other'; allowed: module:factory or path/to/file.py:factory"),
        ("mine.py:broken", r"ZeroDivisionError: division by zero \(.*mine.py, line \d+, in predict\)"),
        ("mine.py:flat", r"its actions have the shape \(3,\), allowed is \(3, 1\)"),
        ("mine.py:no_number", r"the action of row 0 is \[nan\]"),
        ("mine.py:nothing", "the factory returned None; it must be an object with predict"),
        ("mine.py:Forgets", r"TypeError: Forgets.command returned ndarray; it must return two things"),
        ("mine.py:OneNumber", r"TypeError: OneNumber.command returned commands of the shape \(\); allowed is \(3,\)"),
        ("syntax.py:Mine", r"SyntaxError: .*syntax.py, line 2"),
        ("fails.py:Mine", r"KeyError: 'x' \(.*fails.py, line 3, in <module>\)"),
        ("mine", "policy 'mine' is unknown.*or code of your own, module:factory"),
    ],
)
def test_what_is_wrong_is_one_line_that_says_where(folder, capsys, policy, message):
    (folder / "syntax.py").write_text("x = 1\nif:\n")
    (folder / "fails.py").write_text("import json\n\n{}['x']\n")
    code = main(["bench", "short", "--policies", f"pd,{policy}", "--out", "out"])
    error = capsys.readouterr().err
    assert code in (1, 2)
    assert error.count("\n") == 1 and "Traceback" not in error
    assert re.search(message, error), error


def test_no_file_can_name_code(folder, capsys, monkeypatch):
    """A suite that lists code, and a run that was made with code, both refuse until a person names it."""
    (folder / "suite.toml").write_text(
        'name = "s"\ndescription = "d"\nepisodes = 1\npolicies = ["mine.py:Mine"]\n'
        '[[scenario]]\nname = "a"\ntitle = "b"\n'
    )
    (folder / "mine.py").write_text(CODE + "\nopen('ran', 'w').close()\n")
    assert main(["bench", "suite.toml", "--out", "suite"]) == 2
    assert "is code, which only a person may name" in capsys.readouterr().err
    assert not (folder / "ran").exists()
    assert main(["bench", "short", "--policies", "pd,mine.py:Mine", "--out", "out"]) == 0
    (folder / "ran").unlink()
    for name in [name for name in sys.modules if name.startswith("lanekeep_own")]:
        monkeypatch.delitem(sys.modules, name)
    whole = (folder / "out" / "episodes.jsonl").read_text()
    (folder / "out" / "episodes.jsonl").write_text("".join(whole.splitlines(keepends=True)[:4]))
    capsys.readouterr()
    assert main(["bench", "--resume", "--out", "out"]) == 2
    assert "--policies pd,mine.py:Mine" in capsys.readouterr().err
    assert not (folder / "ran").exists()
    assert main(["bench", "--resume", "--out", "out", "--policies", "pd,mine.py:Mine"]) == 0
    assert sorted((folder / "out" / "episodes.jsonl").read_text().splitlines()) == sorted(whole.splitlines())
    (folder / "mine.py").write_text(CODE.replace("0.03", "0.04"))
    assert main(["bench", "--resume", "--out", "out", "--policies", "pd,mine.py:Mine"]) == 2
    assert "policy_sha256 of mine.py:Mine" in capsys.readouterr().err


def test_what_a_file_imports_from_beside_it_is_part_of_the_controller(folder, monkeypatch):
    """In processes of their own, as commands run: another number in a file beside it is another controller."""
    code = "from lanekeep_benchmarks.policies import entry_of; print(entry_of('uses.py:make').sha256)"
    (folder / "uses.py").write_text("from gains import GAIN\n\ndef make(scenario):\n    return GAIN\n")
    found = []
    for gain in (1.0, 1.0, 2.0):
        (folder / "gains.py").write_text(f"GAIN = {gain}\n")
        out = subprocess.run([sys.executable, "-B", "-c", code], cwd=folder, capture_output=True, text=True, check=True)
        found.append(out.stdout)
    assert found[0] == found[1] != found[2] and len(found[0]) == 65


def test_what_has_no_source_is_never_resumed(folder):
    """Whether it still is the same controller cannot be told."""
    scope: dict = {}
    exec("def hidden(scenario):\n    return None", scope)
    assert entry_of(scope["hidden"]).sha256 != entry_of(scope["hidden"]).sha256


def test_a_class_of_a_notebook_has_no_source_and_is_driven(monkeypatch):
    """Cells are no files: the class is one of `__main__`, which has none."""
    notebook = ModuleType("__main__")
    exec(CODE, vars(notebook))
    monkeypatch.setitem(sys.modules, "__main__", notebook)
    entry = entry_of(notebook.Mine)
    assert entry.name == "mine" and entry.sha256.startswith("no source, ")
    assert entry.make(LaneKeepScenario()).predict(np.zeros(6, np.float32))[0].shape == (1,)


@pytest.mark.parametrize("rows", [1, 2])
def test_lines_do_not_depend_on_the_rows(folder, monkeypatch, rows):
    assert main(["bench", "short", "--policies", "mine.py:Mine,mine.py:alone", "--out", "all"]) == 0
    monkeypatch.setattr("lanekeep_benchmarks.evaluate.CARS", rows)
    assert main(["bench", "short", "--policies", "mine.py:Mine,mine.py:alone", "--out", "few"]) == 0
    assert lines(folder / "all") == lines(folder / "few")


def test_cars_alone_begin_anew_with_their_episode():
    class Counter:
        def __init__(self):
            self.count = 0

        def act(self, observation):
            self.count += 1
            return self.count

    policy = OneByOne(Counter)
    action, state = policy.predict(np.zeros((2, 3)))
    action, state = policy.predict(np.zeros((2, 3)), state, np.array([False, True]))
    assert action.tolist() == [[2.0], [1.0]]
    single, state = policy.predict(np.zeros(3))
    assert single.tolist() == [1.0] and policy.predict(np.zeros(3), state)[0].tolist() == [2.0]


def test_a_run_that_failed_before_its_first_line_is_begun_anew(folder, capsys):
    """Nothing is lost, so nothing has to be overwritten; a mended controller goes on with the lines of the others."""
    broken = CODE.replace('return -0.03 * at["lateral_error"]', 'return -0.03 * at["lateral_eror"]')
    assert broken != CODE
    (folder / "mine.py").write_text(broken)
    assert main(["bench", "short", "--policies", "mine.py:Mine", "--out", "out"]) == 1
    assert "lateral_eror" in capsys.readouterr().err
    assert main(["bench", "short", "--policies", "pd,mine.py:Mine", "--out", "out"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "to complete the run: lanekeep bench --resume --out out" in error
    kept = (folder / "out" / "episodes.jsonl").read_text()
    assert kept.count("\n") > 0
    (folder / "mine.py").write_text(CODE)
    assert main(["bench", "--resume", "--out", "out", "--policies", "pd,mine.py:Mine"]) == 0
    assert lines(folder / "out")["mine.py:Mine"] == lines(folder / "out")["pd"]
    assert (folder / "out" / "episodes.jsonl").read_text().startswith(kept)


def test_what_was_handed_over_cannot_be_driven_again_by_a_command(folder, capsys):
    import mine

    lanekeep_benchmarks.benchmark("short", [mine.Mine], episodes=1, out=folder / "out")
    where = ["--run", "out", "--episode", "0", "--policy", "mine", "--scenario", "slalom"]
    assert main(["play", *where]) == 2
    error = capsys.readouterr().err
    assert "policy 'mine' was handed over in Python, so that no command can make it again" in error
    assert error.count("\n") == 1


def test_play_drives_own_code(folder, capsys):
    pytest.importorskip("pygame")
    assert main(["play", "lanekeep/LaneKeep-v0", "--policy", "mine.py:Mine", "--seconds", "0.5"]) == 0
    assert "mine.py:Mine drove 0.5 s" in capsys.readouterr().out
    assert [file.name for file in (folder / "results").iterdir()] == ["LaneKeep-v0-mine.py-Mine-seed0.gif"]


def test_new_controller_runs_and_passes_its_test(folder, capsys):
    assert main(["new", "controller", "far-sighted"]) == 0
    said = capsys.readouterr().out
    assert "far_sighted.py:FarSighted" in said
    assert main(["bench", "short", "--policies", "pd,far_sighted.py:FarSighted", "--out", "out"]) == 0
    test = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_far_sighted.py"]
    assert subprocess.run(test, env=os.environ, cwd=folder, check=False).returncode == 0
    before = (folder / "far_sighted.py").read_bytes()
    capsys.readouterr()
    for name in ("far-sighted", "json", "class", "Far", "../far"):
        assert main(["new", "controller", name]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert (folder / "far_sighted.py").read_bytes() == before


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("mine.py", "'mine.py' is not allowed: it must be module:factory or path/to/file.py:factory"),
        ("mine.py:maek", "no function or class 'maek' (did you mean 'make'?); allowed: one that takes nothing and "),
        ("mine.py:make", "mine.py:make made a dict; it must be a callback of Stable-Baselines3"),
        ("other.py:make", "other.py: No such file or directory"),
    ],
)
def test_what_is_no_callback_is_refused_in_words_of_callbacks(given, words, tmp_path, monkeypatch, capsys):
    pytest.importorskip("stable_baselines3")
    (tmp_path / "mine.py").write_text("def make():\n    return {}\n")
    monkeypatch.chdir(tmp_path)
    assert main(["train", "ppo", "LaneKeep-v0", "--callback", given]) == 2
    told = capsys.readouterr().err
    assert words in told and "policy" not in told and told.count("\n") == 1
    assert not (tmp_path / "results").exists()
