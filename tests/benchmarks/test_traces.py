"""Steps that a run keeps, read back as DataFrames; and its episodes driven again."""

import json

import numpy as np
import pytest

import lanekeep_benchmarks
from lanekeep_benchmarks import evaluate
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.play import Drive, play
from lanekeep_benchmarks.policies import entry_of
from lanekeep_benchmarks.replay import find_line
from lanekeep_benchmarks.suites import SUITES, Suite, SuiteScenario
from lanekeep_benchmarks.web.drives import recorded

pytest.importorskip("pyarrow")

_KEYS = {"departure": "terminate", "preview": 2}
SUITE = Suite(
    "short",
    "a road that can be held, and one that is too narrow",
    (
        SuiteScenario("wide", "wide", {"road": "slalom", **_KEYS}, max_episode_steps=30),
        SuiteScenario("narrow", "narrow", {"road": "slalom", "lane_width": 1.0, **_KEYS}, max_episode_steps=200),
    ),
    episodes=5,
)
POLICIES = ["stanley", "pd"]


@pytest.fixture(scope="module")
def traced(tmp_path_factory):
    """A run with all of its steps, and one with those of failures."""
    folder = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SUITES, "short", SUITE)
        lanekeep_benchmarks.benchmark("short", POLICIES, out=folder / "all", trace=True)
        lanekeep_benchmarks.benchmark("short", POLICIES, out=folder / "failed")
    return folder


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setitem(SUITES, "short", SUITE)


def test_the_metrics_follow_from_the_steps(traced):
    """Every line's metrics, computed again by pandas from its steps, which are kept in single precision."""
    results, steps = lanekeep_benchmarks.read(traced / "all")
    assert len(results) == 2 * 2 * 5
    groups = dict(list(steps.groupby(["scenario", "policy", "episode"], observed=True)))
    assert len(groups) == len(results)
    for _, line in results.iterrows():
        mine = groups[line["scenario"], line["policy"], line["episode"]]
        assert mine["step"].tolist() == list(range(line["steps"]))
        error = mine["lateral_error"].to_numpy(dtype=float)
        # A departure, which ends the episode here, counts for the rest of its length.
        length = 30 if line["scenario"] == "wide" else 200
        held = np.r_[error, np.full(length - len(error), error[-1])] if line["failed"] else error
        assert np.sqrt(np.mean(held**2)) == pytest.approx(line["rms_lateral_error"], rel=1e-6)
        assert np.abs(error).max() == pytest.approx(line["peak_lateral_error"], rel=1e-6)
        assert mine["reward"].sum() == pytest.approx(line["return"], rel=1e-5)
        # What a row's action followed from is what the row before it led to; sensors are perfect here.
        assert mine["observed.lateral_error"].to_numpy()[1:] == pytest.approx(error[:-1], abs=1e-6)
        assert mine["action_0"].abs().max() > 0.0


def test_failures_are_kept_always(traced):
    results, steps = lanekeep_benchmarks.read(traced / "failed")
    failed = results[results["failed"]]
    assert 0 < len(failed) < len(results)
    kept = {(row.scenario, row.policy, row.episode) for row in steps.itertuples()}
    assert kept == {(row.scenario, row.policy, row.episode) for row in failed.itertuples()}
    _, whole = lanekeep_benchmarks.read(traced / "all")
    keys = ["scenario", "policy", "episode", "step"]
    both = whole.merge(steps, on=keys, suffixes=("", "_again"))
    assert len(both) == len(steps) and (both["lateral_error"] == both["lateral_error_again"]).all()


def test_a_run_that_was_cut_short_has_all_of_its_steps_in_the_end(traced, tmp_path):
    out = tmp_path / "run"
    out.mkdir()
    (out / "run.json").write_bytes((traced / "all" / "run.json").read_bytes())
    lines = (traced / "all" / "episodes.jsonl").read_text().splitlines(keepends=True)
    (out / "episodes.jsonl").write_text("".join(lines[:7]))
    first = traced / "all" / "traces" / "wide.stanley.000000.parquet"
    (out / "traces").mkdir()
    (out / "traces" / first.name).write_bytes(first.read_bytes())
    assert main(["bench", "--resume", "--out", str(out)]) == 0
    _, steps = lanekeep_benchmarks.read(out)
    _, whole = lanekeep_benchmarks.read(traced / "all")
    keys = ["scenario", "policy", "episode", "step"]
    assert (
        steps.astype({key: str for key in keys[:2]})
        .sort_values(keys)
        .reset_index(drop=True)
        .equals(whole.astype({key: str for key in keys[:2]}).sort_values(keys).reset_index(drop=True))
    )


def test_overwriting_removes_old_traces(traced, tmp_path):
    out = tmp_path / "run"
    lanekeep_benchmarks.benchmark("short", POLICIES, episodes=2, out=out, trace=True)
    lanekeep_benchmarks.benchmark("short", ["stanley", "pure-pursuit"], episodes=2, out=out, overwrite=True, trace=True)
    _, steps = lanekeep_benchmarks.read(out)
    assert set(steps["policy"]) == {"stanley", "pure-pursuit"}


def test_what_is_no_trace_is_named(traced, tmp_path):
    with pytest.raises(ValueError, match=r"holds no results: episodes.jsonl is missing"):
        lanekeep_benchmarks.read(tmp_path)
    (tmp_path / "episodes.jsonl").write_bytes((traced / "all" / "episodes.jsonl").read_bytes())
    (tmp_path / "traces").mkdir()
    (tmp_path / "traces" / "a.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(ValueError, match=r"a\.parquet is not a trace"):
        lanekeep_benchmarks.read(tmp_path)


def test_a_line_driven_again_is_the_same_episode(traced):
    """Alone, in the single environment: as many steps, and the metrics to the last bit."""
    lines = map(json.loads, (traced / "all" / "episodes.jsonl").read_text().splitlines())
    for line in lines:
        found = find_line(traced / "all", line["episode"], line["scenario"], line["policy"])
        pytest.importorskip("pygame")
        driven = play(Drive.of_line(found), None, lambda picture: None) if line["episode"] == 0 else None
        if driven is not None:
            assert driven.steps == line["steps"] and driven.departed == line["failed"]
            assert driven.peak_lateral_error == line["metrics"]["peak_lateral_error"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--episode", "1"], "--run and --episode go together"),
        (["--run", "{run}", "--episode", "1"], "--scenario is missing; the run has wide, narrow"),
        (["--run", "{run}", "--episode", "1", "--scenario", "wide"], "--policy is missing; the run has stanley, pd"),
        (["--run", "{run}", "--episode", "9", "--scenario", "wide", "--policy", "pd"], "a complete run has 0 to 4"),
        (["--run", "{run}", "--episode", "1", "--scenario", "wid", "--policy", "pd"], "did you mean 'wide'?"),
        (["--run", "{run}/nowhere", "--episode", "1"], "holds no run"),
        (["--run", "{run}", "--episode", "1", "--road", "slalom"], "leave --road out"),
    ],
)
def test_what_cannot_be_driven_again_is_one_line(traced, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    given = [part.format(run=traced / "all") for part in arguments]
    assert main(["play", *given]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


def test_play_shows_a_failure(traced, tmp_path, monkeypatch, capsys):
    pytest.importorskip("pygame")
    monkeypatch.chdir(tmp_path)
    results, _ = lanekeep_benchmarks.read(traced / "all")
    line = results[results["failed"]].iloc[0]
    where = ["--run", str(traced / "all"), "--scenario", line["scenario"], "--policy", line["policy"]]
    assert main(["play", *where, "--episode", str(line["episode"])]) == 0
    assert "left its lane" in capsys.readouterr().out
    assert (tmp_path / "results" / f"narrow-{line['policy']}-episode{line['episode']}.gif").is_file()


def test_an_action_follows_from_what_its_row_observed(traced):
    """`pd` without memory, computed again from every row."""
    _, steps = lanekeep_benchmarks.read(traced / "all")
    mine = steps.query("policy == 'pd'")
    law = -0.03 * mine["observed.lateral_error"].astype(float) - 0.6 * mine["observed.heading_error"].astype(float)
    assert mine["action_0"].to_numpy() == pytest.approx((law / 0.15).to_numpy(), abs=1e-6)


def test_another_road_is_not_driven_for_the_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    points = [(200 * np.cos(t), 200 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 120, endpoint=False)]
    road = tmp_path / "mine.csv"
    road.write_text("x_m,y_m\n" + "".join(f"{x:.6f},{y:.6f}\n" for x, y in points))
    assert main(["bench", "--road", "mine.csv", "--policies", "stanley", "--episodes", "1", "--out", "out"]) == 0
    road.write_text("x_m,y_m\n" + "".join(f"{1.5 * x:.6f},{1.5 * y:.6f}\n" for x, y in points))
    capsys.readouterr()
    assert main(["play", "--run", "out", "--episode", "0"]) == 2
    error = capsys.readouterr().err
    assert "is not the one of the run: its hash is" in error and error.count("\n") == 1
    record = tmp_path / "out" / "run.json"  # nor with other code, and what is told is told of --run
    record.write_text(json.dumps(json.loads(record.read_text()) | {"code": "0123"}))
    assert main(["play", "--run", "out", "--episode", "0"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("lanekeep: --run out cannot be driven again as it was: code is '0123' there")
    assert error.count("\n") == 1 and "--out" not in error and "--resume" not in error


def test_one_row_is_one_drive_of_the_evaluation(traced):
    """`recorded` and the trace tell the same of an episode."""
    _, steps = lanekeep_benchmarks.read(traced / "all")
    scenario = SUITE.scenarios[0]
    env = evaluate.make_cars(scenario, 1)
    policy = entry_of("stanley").make(env.unwrapped.scenario)
    env.close()
    seed = evaluate.episode_seed("short", "wide", 0, 0)
    (driven,) = recorded(scenario, policy, [seed])
    mine = steps.query("scenario == 'wide' and policy == 'stanley' and episode == 0")
    for name in ("lateral_error", "speed", "heading_error"):
        assert mine[name].to_numpy() == pytest.approx(driven[name].astype(np.float32), abs=0.0)
