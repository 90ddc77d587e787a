"""`lanekeep bound`: its lines, its row in a run's tables, and how it goes on after a kill."""

import json

import pytest
from typer.testing import CliRunner

import lanekeep_baselines
from lanekeep_benchmarks import bound as bounds
from lanekeep_benchmarks.cli import app, run
from lanekeep_benchmarks.results import read_lines
from lanekeep_env.scenario import CircuitScenario, LaneKeepScenario

SUITE = """
name = "mine"
description = "two roads and a circuit's worth of doubt"
episodes = 3
[common.keywords]
preview = 20
[[scenario]]
name = "heavy"
title = "Heavy"
keywords = { randomisation = { mass = 1.2 } }
[[scenario]]
name = "drawn"
title = "Drawn"
keywords = { randomisation = "mismatch", tyre = "magic_formula", road = { kind = "random", seed = 3 } }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run of two policies, then its bounds."""
    there = tmp_path_factory.mktemp("bound")
    (there / "mine.toml").write_text(SUITE)
    out = there / "out"
    arguments = ["bench", str(there / "mine.toml"), "--policies", "lq-preview,lq-preview-offset-free"]
    assert run([*arguments, "--out", str(out)]) == 0
    assert run(["bound", "--out", str(out)]) == 0
    return out


def _lines(folder):
    return [line for _, line in read_lines((folder / "episodes.jsonl").read_bytes())]


def test_no_policy_is_better_on_any_episode_of_the_run(folder):
    best = {line.place: line for line in _lines(folder / "bound") if line.policy == "bound"}
    driven = _lines(folder)
    assert len(best) == 6 and len(driven) == 12
    for line in driven:
        bound = best[line.scenario, "bound", line.episode]
        assert bound.episode_seed == line.episode_seed and not bound.failed
        assert bound.metrics["return"] >= line.metrics["return"]


def test_tables_of_the_run_have_its_row_and_the_shares_of_it(folder):
    summary = json.loads((folder / "summary.json").read_text())
    heavy, drawn = summary["scenarios"]
    # A car that is drawn is another one in each episode: no controller can be made for it.
    assert [row["policy"] for row in heavy["bounds"]] == ["bound", "lq-told-the-truth"]
    assert [row["policy"] for row in drawn["bounds"]] == ["bound"]
    returns = {}
    for line in [*_lines(folder), *_lines(folder / "bound")]:
        returns.setdefault((line.scenario, line.policy), []).append(line.metrics["return"])
    for entry in (heavy, drawn):
        name = entry["scenario"]
        for row in (*entry["policies"], *entry["bounds"]):
            share = sum(returns[name, "bound"]) / sum(returns[name, row["policy"]])
            assert row["share_of_bound"] == pytest.approx(share) and 0.0 < share <= 1.0
    told = heavy["bounds"][1]["share_of_bound"]
    assert told > max(row["share_of_bound"] for row in heavy["policies"])
    text = (folder / "summary.md").read_text()
    assert "share of the bound [%]" in text and "\n| bound |" in text
    assert f"{100 * told:.1f} % of the bound".replace(" %", "%") in text


def test_bounds_go_on_where_they_were_killed(folder, tmp_path):
    whole = (folder / "bound" / "episodes.jsonl").read_bytes()
    again = tmp_path / "again"
    (again / "bound").mkdir(parents=True)
    (again / "bound" / "run.json").write_bytes((folder / "bound" / "run.json").read_bytes())
    # Killed in the middle of the second scenario's lines.
    (again / "bound" / "episodes.jsonl").write_bytes(whole[: len(whole) - 700])
    assert run(["bound", "--resume", "--out", str(again)]) == 0
    assert sorted((again / "bound" / "episodes.jsonl").read_bytes().splitlines()) == sorted(whole.splitlines())


def test_bounds_in_the_folder_stay_unless_asked(folder, capsys):
    assert run(["bound", "--out", str(folder)]) == 2
    assert "already holds results" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["circuit"], "has no scenario of which a bound is known: it has no road"),
        (["camera"], "a camera judges it"),
        (["learnd"], "suite 'learnd' is unknown (did you mean 'learned'?)"),
        ([], "SUITE is missing"),
        (["learned", "--episodes", "0"], "--episodes=0 is not allowed"),
    ],
)
def test_errors_are_one_line(arguments, words, tmp_path, capsys):
    assert run(["bound", *arguments, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1


def test_another_suite_than_the_runs_is_refused(folder, capsys):
    assert run(["bound", "classical", "--out", str(folder)]) == 2
    assert "holds a run of the suite" in capsys.readouterr().err


def test_bounds_of_other_episodes_are_left_out(folder, tmp_path, monkeypatch):
    """A bench in a folder whose bounds are of another seed says nothing of them."""
    from lanekeep_benchmarks.bound_table import read_bounds

    summary = json.loads((folder / "summary.json").read_text())
    assert len(read_bounds(folder, summary)) == 3
    assert read_bounds(folder, {**summary, "seed": 1}) == {}
    summary["scenarios"][0]["scenario_hash"] = "0" * 16
    assert read_bounds(folder, summary) == {}
    assert read_bounds(tmp_path, summary) == {}


def test_the_truth_is_the_car_that_is_driven():
    drawn = {
        "mass": 1.2,
        "steering_lag": 2.0,
        "steering_delay": 0.05,
        "cg_shift": 0.1,
        "front_cornering_stiffness": 0.8,
    }
    definition = LaneKeepScenario(preview=20, randomisation=drawn)
    truth, car = bounds.told_the_truth(definition).vehicle, definition.vehicle
    assert truth.mass == 1.2 * car.mass and truth.yaw_inertia == 1.2 * car.yaw_inertia
    assert truth.steering.lag == 2.0 * car.steering.lag and truth.steering.delay == 0.05
    assert truth.cg_to_front_axle == car.cg_to_front_axle - 0.1 and truth.wheelbase == pytest.approx(car.wheelbase)
    assert truth.front_cornering_stiffness == 0.8 * car.front_cornering_stiffness
    assert bounds.told_the_truth(LaneKeepScenario(preview=20, randomisation="mismatch")) is None
    assert bounds.told_the_truth(LaneKeepScenario()) is None  # no road ahead to tell lq-preview of
    assert bounds.told_the_truth(CircuitScenario()) is None


def test_help_teaches():
    said = CliRunner().invoke(app, ["bound", "--help"]).output
    assert "Example: lanekeep bench learned" in said and "share of the bound" in " ".join(said.split())


def test_starts_are_known_policies():
    assert set(bounds.STARTS) <= set(lanekeep_baselines.names())
