"""A suite whose environments have policies of their own: who drives what, its tables, its page, entrants."""

import json

import pytest

from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.plan import make_plan

SUITE = """
name = "mixed"
description = "forwards and backwards"
episodes = 2
per_environment = true
policies = ["stanley", "werling-reverse", "pd"]

[common]
max_episode_steps = 20

[[scenario]]
name = "slalom"
title = "A slalom"
keywords = { road = "slalom", departure = "cost", preview = 1 }

[[scenario]]
name = "back"
title = "Backwards"
env_id = "lanekeep/ReversePath-v0"
keywords = { departure = "cost" }

[[scenario]]
name = "circle"
title = "A circle"
keywords = { road = "circle", departure = "cost", preview = 1 }
"""
FORWARDS = """
import lanekeep_baselines

def forwards(scenario):
    if not hasattr(scenario, "preview") or scenario.preview == 0:
        raise ValueError("it drives forwards alone")
    return lanekeep_baselines.make("stanley", scenario)

def broken(scenario):
    return scenario.nothing_of_the_kind
"""
DRIVERS = {"slalom": ["stanley", "pd"], "back": ["werling-reverse", "pd"], "circle": ["stanley", "pd"]}


@pytest.fixture
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mixed.toml").write_text(SUITE)
    (tmp_path / "mine.py").write_text(FORWARDS)
    return tmp_path


def test_each_environment_is_driven_by_those_that_can(there):
    assert main(["bench", "mixed.toml", "--out", "out"]) == 0
    lines = [json.loads(line) for line in (there / "out" / "episodes.jsonl").read_text().splitlines()]
    places = {(line["scenario"], line["policy"], line["episode"]) for line in lines}
    assert places == {(scenario, name, n) for scenario, names in DRIVERS.items() for name in names for n in range(2)}
    summary = json.loads((there / "out" / "summary.json").read_text())
    assert summary["parts"] == {"LaneKeep-v0": ["slalom", "circle"], "ReversePath-v0": ["back"]}
    assert summary["reference"] is None
    for entry in summary["scenarios"]:
        assert [row["policy"] for row in entry["policies"]] == DRIVERS[entry["scenario"]]
        assert [row["verdict"] is None for row in entry["policies"]] == [True, False]
    table = (there / "out" / "summary.md").read_text()
    assert "## Return: LaneKeep-v0" in table and "worse than the first of each table" in table
    assert {file.name for file in (there / "out").glob("plot_[ep]*_*-v0.png")} == {
        f"plot_{what}_{part}.png" for what in ("errors", "profiles") for part in ("LaneKeep-v0", "ReversePath-v0")
    }


def test_an_entrant_drives_what_it_can_and_is_told_of_what_is_broken(there, capsys):
    plan = make_plan("mixed.toml", ["stanley", "mine.py:forwards"], None, None, 0)
    assert plan.drivers == {name: ["stanley", "mine.py:forwards"] for name in ("slalom", "circle")}
    assert plan.total == 8 and set(plan.record.scenario_hash) == set(plan.record.metrics) == {"slalom", "circle"}
    for policy, words in (
        ("mine.py:broken", "mine.py:broken cannot drive slalom of mixed: policy 'mine.py:broken': AttributeError"),
        ("lane-support", "lane-support cannot drive slalom of mixed: "),
    ):
        assert main(["bench", "mixed.toml", "--policies", f"stanley,{policy}", "--out", "out"]) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1


def test_a_part_is_resumed_as_it_was_begun(there):
    words = ["--policies", "werling-reverse", "--out", "out"]
    assert main(["bench", "mixed.toml", *words]) == 0
    whole = {file.name: file.read_bytes() for file in (there / "out").rglob("*.*")}
    lines = whole.pop("episodes.jsonl")
    (there / "out" / "episodes.jsonl").write_bytes(lines.splitlines(keepends=True)[0])
    assert main(["bench", "--resume", "--out", "out"]) == 0
    again = {file.name: file.read_bytes() for file in (there / "out").rglob("*.*")}
    assert again.pop("episodes.jsonl") == lines and again == whole
    assert main(["verify", "out"]) == 0
