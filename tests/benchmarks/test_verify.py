"""`lanekeep verify`: honest runs hold; edited numbers, a look-up entrant and one that patches the simulator do not."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.evaluate import episode_seed, make_cars
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.report import failures
from lanekeep_benchmarks.results import EPISODES, SUMMARY, TABLE, read_lines
from lanekeep_benchmarks.run_record import RUN
from lanekeep_benchmarks.suites import read_suite
from lanekeep_benchmarks.verify import again, fresh

SUITE = """
name = "short"
description = "a slalom"
episodes = 4

[[scenario]]
name = "slalom"
title = "A slalom"
keywords = { road = "slalom", departure = "cost", preview = 1 }
max_episode_steps = 20
"""
#: `stanley` on episodes whose first observation it knows, a constant angle on others.
LOOK_UP = """
import lanekeep_baselines, numpy as np

KNOWN = np.load("known.npy")
open("ran", "a").close()

class LookUp:
    def __init__(self, scenario):
        self.good = lanekeep_baselines.make("stanley", scenario)

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        if state is None:
            state = (observation[:, None] == KNOWN[None]).all(axis=2).any(axis=1)
        action, _ = self.good.predict(observation)
        return np.where(state[:, None], action, 1.0), state
"""
#: Drives straight on, and whoever measures it in its process measures no errors and a return of 0.
TAMPERS = """
import numpy as np
from lanekeep_benchmarks import evaluate, metrics

whole = metrics.Measured.results
metrics.Measured.results = lambda self: {key: 0.0 * values for key, values in whole(self).items()}
print("0 differ", flush=True)

class Tampers:
    def __init__(self, scenario):
        pass

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros((len(observation), 1), dtype=np.float32), None
"""


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """An honest run."""
    folder = tmp_path_factory.mktemp("honest")
    (folder / "short.toml").write_text(SUITE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["bench", "short.toml", "--policies", "stanley,pd", "--out", "out"]) == 0
    return folder / "out"


@pytest.fixture
def there(tmp_path, monkeypatch):
    """A folder with the suite and both entrants, in which commands run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SUITE)
    (tmp_path / "look_up.py").write_text(LOOK_UP)
    (tmp_path / "tampers.py").write_text(TAMPERS)
    return tmp_path


@pytest.fixture
def honest(there, driven):
    """The folder of an honest run, to be spoilt."""
    return Path(shutil.copytree(driven, there / "out"))


def verified(capsys, *words):
    """The exit code and what is said, as plain data."""
    capsys.readouterr()
    code = main(["verify", *words, "--json"])
    captured = capsys.readouterr()
    return code, json.loads(captured.out) if code < 2 else captured.err


def lines_of(out):
    return [json.loads(line) for line in (out / EPISODES).read_text().splitlines()]


def test_an_honest_run_holds_and_both_scores_are_told(honest, capsys, monkeypatch):
    monkeypatch.setattr(again, "LEAST", 1)  # of many episodes a tenth
    code, found = verified(capsys, "out")
    assert code == 0 and found["holds"] and not found["faults"] and not found["left_out"]
    assert found["driven_again"] == 1 and found["lines"] == 8
    returns = {
        name: [one["metrics"]["return"] for one in lines_of(honest) if one["policy"] == name]
        for name in ("stanley", "pd")
    }
    for score in found["scores"]:
        assert score["key"] == "return" and score["claimed"] == pytest.approx(np.mean(returns[score["policy"]]))
        assert score["difference"]["low"] < score["fresh"] - score["claimed"] < score["difference"]["high"]
    assert found["machines"] == [found["verified_on"]] == json.loads((honest / RUN).read_text())["machines"]
    assert found["verified_on"]["python"] == sys.version.split()[0]
    assert main(["verify", "out"]) == 0
    text = capsys.readouterr().out
    assert "Driven again: 1 of 8 episodes; 0 differ" in text and "out: holds" in text and "stanley" in text


def test_each_verification_draws_its_own_episodes(honest, capsys):
    seeds = {verified(capsys, "out")[1]["fresh_seed"] for _ in range(2)}
    assert len(seeds) == 2 and not seeds & {0}


def _returns_nothing(line):
    line["metrics"]["return"] = 0.0


def _heads_better(line):
    line["metrics"]["rms_heading_error"] *= 1.0 - 1e-4


def _fails(line):
    line["failed"] = not line["failed"]


def _is_shorter(line):
    line["steps"] = 19


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_returns_nothing, "return is 0 in the folder"),
        (_heads_better, "rms_heading_error is "),
        (_fails, "failed is True in the folder, False driven"),
        (_is_shorter, "steps is 19 in the folder, 20 driven"),
    ],
)
def test_an_edited_line_is_found_where_it_is_drawn(change, words, honest, capsys, monkeypatch):
    """Of so few episodes every one is drawn."""
    monkeypatch.setattr(fresh, "EPISODES", 2)
    lines = lines_of(honest)
    change(lines[0])
    (honest / EPISODES).write_text("".join(json.dumps(line) + "\n" for line in lines))
    code, found = verified(capsys, "out")
    assert code == 1 and not found["holds"] and found["driven_again"] == 8
    assert words in found["faults"][-1] and "1 of 4 episodes driven again differ" in found["faults"][-1]


def _another_hash(text):
    return re.sub(r'("slalom": )"\w{16}"', r'\1"0123456789abcdef"', text)


@pytest.mark.parametrize(
    ("file", "change", "words"),
    [
        (
            SUMMARY,
            lambda text: re.sub(r'"failures": \d+', '"failures": 9', text, count=1),
            "is not what the lines give",
        ),
        (TABLE, lambda text: text.replace("| stanley |", "| stanley | 0.0 |", 1), "summary.md does not show"),
        (EPISODES, lambda text: text.partition("\n")[2], "1 of 4 episodes of stanley on slalom are missing"),
        (EPISODES, lambda text: text + text.partition("\n")[0] + "\n", "line 9 repeats slalom, stanley, 0"),
        (EPISODES, lambda text: text.replace('"episode_seed": ', '"episode_seed": 1', 1), "line 1: episode_seed is 1"),
        (RUN, _another_hash, "scenario_hash of slalom is '0123456789abcdef'"),
    ],
)
def test_files_that_do_not_agree_are_found(file, change, words, honest, capsys, monkeypatch):
    monkeypatch.setattr(fresh, "EPISODES", 2)
    text = (honest / file).read_text()
    assert change(text) != text
    (honest / file).write_text(change(text))
    code, found = verified(capsys, "out")
    assert code == 1 and words in found["faults"][0]


def test_what_was_spent_on_policies_is_no_part_of_a_claim(honest, capsys, monkeypatch):
    """Their files tell it, which may be gone; before it was told, tables were without."""
    monkeypatch.setattr(fresh, "EPISODES", 2)
    text = (honest / TABLE).read_text()
    failed = failures([line for _, line in read_lines((honest / EPISODES).read_bytes())])
    (honest / TABLE).write_text(text.removesuffix(failed) + "\n## Budgets\n\n| a | 1 |\n" + failed)
    assert verified(capsys, "out")[0] == 0
    (honest / TABLE).write_text(text.removesuffix(failed) + "\n## Returns\n\n| a | 1 |\n" + failed)
    assert verified(capsys, "out")[0] == 1


def test_a_look_up_entrant_runs_where_it_is_named_and_is_found_by_fresh_episodes(there, capsys, monkeypatch):
    """What it claims is what it drives, in another process, too: only episodes that it has not seen tell."""
    cars = make_cars(read_suite("short.toml").scenarios[0], 4)
    known, _ = cars.reset(seed=[episode_seed("short", "slalom", number, 0) for number in range(4)])
    cars.close()
    np.save("known.npy", known)
    assert main(["bench", "short.toml", "--policies", "stanley,look_up.py:LookUp", "--out", "out"]) == 0
    table = {line["policy"]: line["metrics"] for line in lines_of(there / "out")}
    assert table["look_up.py:LookUp"] == table["stanley"]
    (there / "ran").unlink()
    code, found = verified(capsys, "out")
    assert code == 0 and "--policies look_up.py:LookUp" in found["left_out"]["look_up.py:LookUp"]
    assert {score["policy"] for score in found["scores"]} == {"stanley"} and not (there / "ran").exists()
    code, found = verified(capsys, "out", "--policies", "look_up.py:LookUp")
    assert code == 1 and not found["left_out"] and (there / "ran").exists()
    assert (found["driven_again"], found["differ"]) == (8, 0)
    (fault,) = found["faults"]
    assert fault.startswith("look_up.py:LookUp on slalom: return is ") and "on fresh episodes" in fault
    assert {score["policy"] for score in found["scores"] if score["worse"]} == {"look_up.py:LookUp"}
    (there / "look_up.py").write_text(f"{LOOK_UP}# better")
    code, found = verified(capsys, "out", "--policies", "look_up.py:LookUp")
    assert code == 1 and found["faults"] == ["look_up.py:LookUp: its file is not the one of the run"]


def test_an_entrant_that_patches_who_measures_it_is_found(there, capfd, monkeypatch):
    """The run believes it; verify, whose process it never enters, does not, whatever it prints."""
    bench = ["bench", "short.toml", "--policies", "stanley,tampers.py:Tampers", "--out", "out"]
    subprocess.run([sys.executable, "-m", "lanekeep_benchmarks", *bench], check=True, capture_output=True)
    assert all(line["metrics"]["return"] == 0.0 for line in lines_of(there / "out"))
    assert main(["verify", "out", "--policies", "tampers.py:Tampers"]) == 1
    text = capfd.readouterr().out
    assert "tampers.py:Tampers on slalom: 4 of 4 episodes driven again differ" in text and "8 differ" in text
    assert "\n0 differ" not in text and "tampers" not in sys.modules


def test_what_cannot_be_verified_is_one_line(honest, there, capsys):
    for words, error in (
        (["none"], "holds no run: run.json is missing"),
        (["out", "--policies", "mine.py:Mine"], "--policies 'mine.py:Mine' is none of the run's: stanley, pd"),
    ):
        code, text = verified(capsys, *words)
        assert code == 2 and error in text and text.count("\n") == 1
    (honest / RUN).write_text((honest / RUN).read_text().replace('"code": "', '"code": "0'))
    code, text = verified(capsys, "out")
    assert code == 2 and "cannot be driven again as it was" in text


def test_honest_policies_are_accused_as_rarely_as_stated():
    """Scores of one distribution, with the long tail of departures, 390 comparisons at a time."""
    generator = np.random.default_rng(2026)
    draws = (generator.lognormal(0.0, 1.5, 96) for _ in range(390))
    results = [fresh.compared(made_up(scores[:64]), made_up(scores[64:])) for scores in draws]
    assert not any(result.worse(390) for result in results)
    assert 0.03 < np.mean([result.probability < 0.05 for result in results]) < 0.07  # within two standard deviations


def made_up(scores):
    return [
        EpisodeResult("s", "x", "0" * 16, "p", number, 0, number, False, 1, {"return": -float(score)}, "0.1.0")
        for number, score in enumerate(scores)
    ]
