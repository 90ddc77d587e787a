"""Result folder, summary and tables on made-up result lines, where every number is known."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.looks import interesting, styles
from lanekeep_benchmarks.metrics import METRICS, metrics_of
from lanekeep_benchmarks.report import caption, cells, failures, headings, markdown, terminal_table
from lanekeep_benchmarks.results import EPISODES, SUMMARY, ResultFolder
from lanekeep_benchmarks.run_record import RUN, RunRecord
from lanekeep_benchmarks.suites import Suite, SuiteScenario
from lanekeep_benchmarks.summary import rows_of, summarise
from lanekeep_env.files import write_atomic

SUITE = Suite(
    "made-up",
    "two policies on one scenario",
    (SuiteScenario("scenario", "A scenario", {"road": "random"}),),
    episodes=20,
)
RECORD = RunRecord("0.1.0", "c" * 16, "made-up", None, ["a", "b"], 20, 0, {"scenario": "0" * 16})

#: Where lanes are kept.
ERRORS = tuple(
    METRICS[key]
    for key in metrics_of(
        "lanekeep/LaneKeep-v0", ["lateral_error", "heading_error", *("lateral_acceleration", "steering_rate")]
    )
)


def line(policy, episode, error, failed=False):
    metrics = {column.key: error for column in ERRORS}
    return EpisodeResult(
        "made-up", "scenario", "0" * 16, policy, episode, 0, 1000 + episode, failed, 600, metrics, "0.1.0"
    )


@pytest.fixture
def results():
    """b is 0.1 m worse than a on every episode, whose own errors spread widely; b fails once."""
    errors = np.random.default_rng(0).uniform(0.5, 5.0, 20)
    lines = [line("a", i, error) for i, error in enumerate(errors)]
    return lines + [line("b", i, error + 0.1, failed=i == 3) for i, error in enumerate(errors)]


def test_summary_pairs_the_episodes(results):
    shuffled = [results[i] for i in np.random.default_rng(1).permutation(len(results))]
    summary = summarise(SUITE, shuffled, ["a", "b"])
    assert summary == summarise(SUITE, results, ["a", "b"])
    first, second = summary["scenarios"][0]["policies"]
    assert (first["failures"], second["failures"]) == (0, 1)
    assert second["failure_rate"]["value"] == pytest.approx(0.05)
    assert first["difference_to_reference"] is None
    error, difference = second["metrics"]["rms_lateral_error"], second["difference_to_reference"]["rms_lateral_error"]
    assert error["high"] - error["low"] > 0.5
    assert [difference[key] for key in ("value", "low", "high")] == pytest.approx([0.1] * 3, abs=1e-9)
    json.dumps(summary, allow_nan=False)


def test_unpaired_episodes_are_refused(results):
    with pytest.raises(ValueError, match="scenario: b and a have not driven the same episodes"):
        summarise(SUITE, results[:-1], ["a", "b"])


def test_one_episode_has_values_without_intervals():
    summary = summarise(SUITE, [line("a", 0, 1.5), line("b", 0, 1.0)], ["a", "b"])
    row = summary["scenarios"][0]["policies"][1]
    assert row["metrics"]["return"] == {"value": 1.0, "low": None, "high": None}
    assert cells(row, ERRORS)[1] == ("1.000", "")
    assert "one episode allows none" in caption(summary)


@pytest.mark.parametrize("values", [(0.0, 0.0, 0.9), (0.3, 0.0, 0.0, 0.0)])
def test_intervals_end_where_their_metrics_do(values):
    """Student's, of three or four, would begin below 0; a return has a sign."""
    lines = [line(name, i, value) for name in ("a-seed0", "a-seed1", "b") for i, value in enumerate(values)]
    for row in summarise(SUITE, lines, ["a-seed0", "a-seed1", "b"])["scenarios"][0]["policies"]:
        for kind in ("metrics", "interquartile_mean"):
            assert row[kind]["rms_lateral_error"]["low"] >= 0.0
        assert row["metrics"]["return"]["low"] < 0.0


def test_a_policy_without_results_is_named(results):
    with pytest.raises(ValueError, match="scenario: there are no results of c"):
        summarise(SUITE, results, ["a", "c"])


def test_tables_show_every_policy_and_number(results):
    summary = summarise(SUITE, results, ["a", "b"])
    text = markdown(summary)
    rows = [text_line for text_line in text.splitlines() if text_line.startswith("|")]
    assert len(rows) == 4
    assert {row.count("|") for row in rows} == {len(headings(ERRORS, "a")) + 1}
    assert "+0.100<br>+0.100…+0.100" in rows[-1]
    assert re.search(r"\| 5\.0<br>0\.9…23\.6 \|", rows[-1])
    table = terminal_table(summary["scenarios"][0], "a", 260)
    assert table.row_count == 2
    assert len(table.columns) == len(headings(ERRORS, "a"))


def test_several_scenarios_have_an_overview_of_returns(results):
    """b's return is the larger one: the number stands for any metric, and more return is better."""
    other = [replace(result, scenario="other", failed=False) for result in results]
    suite = replace(SUITE, scenarios=(*SUITE.scenarios, replace(SUITE.scenarios[0], name="other")))
    summary = summarise(suite, [*results, *other], ["a", "b"])
    text = markdown(summary)
    assert "| policy | scenario | other |" in text
    row = next(text_line for text_line in text.splitlines() if text_line.startswith("| b |"))
    value = np.mean([result.metrics["return"] for result in results if result.policy == "b"])
    assert row.count(f"| {value:.2f} ▲<br>") == 2 and row.count("5.0% failed") == 1
    assert "## Return" not in markdown(summarise(SUITE, results, ["a", "b"]))


def test_training_seeds_share_a_row():
    policies = ["pd", "a-seed3", "b", "a-seed0", "c-seed7", "x/d-seed0.json", "x/d-seed12.json", "a", "a-seeds"]
    assert rows_of(policies) == {
        "pd": ["pd"],
        "a (2 seeds)": ["a-seed3", "a-seed0"],
        "b": ["b"],
        "c-seed7": ["c-seed7"],
        "x/d.json (2 seeds)": ["x/d-seed0.json", "x/d-seed12.json"],
        "a": ["a"],
        "a-seeds": ["a-seeds"],
    }


def test_seeds_widen_the_interval_and_pool_the_failures():
    """Three seeds 0.2 m, 0.3 m and 0.4 m worse than the reference on every episode: Student's interval of three."""
    errors = np.random.default_rng(0).uniform(0.5, 5.0, 20)
    lines = [line("ref", i, error) for i, error in enumerate(errors)]
    for seed, more in enumerate((0.2, 0.3, 0.4)):
        lines += [line(f"ppo-seed{seed}", i, error + more, failed=i < 20 * seed) for i, error in enumerate(errors)]
    policies = ["ref", "ppo-seed0", "ppo-seed1", "ppo-seed2"]
    summary = summarise(SUITE, lines, policies)
    second = summary["scenarios"][0]["policies"][1]
    assert (second["policy"], second["seeds"], second["failures"]) == ("ppo (3 seeds)", 3, 40)
    assert second["failure_rate"]["value"] == pytest.approx(2 / 3)
    difference = second["difference_to_reference"]["rms_lateral_error"]
    half = stats.t.ppf(0.975, 2) * 0.1 / math.sqrt(3)
    assert [difference[key] for key in ("value", "low", "high")] == pytest.approx([0.3, 0.3 - half, 0.3 + half])
    assert "training seeds" in caption(summary) and "▼ worse than ref" in caption(summary)
    turned = summarise(SUITE, lines, policies[1:] + policies[:1])
    assert turned["reference"] == "ppo (3 seeds)"
    reverse = turned["scenarios"][0]["policies"][1]["difference_to_reference"]["rms_lateral_error"]
    assert [reverse[key] for key in ("value", "low", "high")] == pytest.approx([-0.3, -0.3 - half, -0.3 + half])


def test_marks_say_who_wins():
    """b errs 0.1 m more, which is worse of an error and better of a return; c is on average the same; a often fails."""
    generator = np.random.default_rng(2)
    errors, swing = generator.uniform(0.5, 5.0, 20), np.resize([0.3, -0.3], 20)
    lines = [line("a", i, error, failed=i % 2 == 0) for i, error in enumerate(errors)]
    lines += [line("b", i, error + 0.1) for i, error in enumerate(errors)]
    lines += [line("c", i, error + swing[i], failed=i % 2 == 1) for i, error in enumerate(errors)]
    a, b, c = summarise(SUITE, lines, ["a", "b", "c"])["scenarios"][0]["policies"]
    assert a["verdict"] is None
    worse = {column.key: "worse" for column in ERRORS}
    assert b["verdict"] == worse | {"return": "better", "time": "better", "failure_rate": "better"}
    assert b["difference_to_reference"]["failure_rate"]["value"] == -0.5
    assert set(c["verdict"].values()) == {"tie"}
    marks = [value[-2:] for value, _ in cells(b, ERRORS)]
    assert marks[:2] == [" ▲", " ▼"] and marks[len(ERRORS)] == " ▲"
    assert not any(mark in cell for row in (a, c) for cell, _ in cells(row, ERRORS) for mark in "▲▼")


def test_lines_are_on_disk_at_once(tmp_path, results):
    with ResultFolder(tmp_path / "deep" / "out", RECORD) as folder:
        folder.append(results[:2])
        lines = (folder.path / EPISODES).read_text().splitlines()
    assert [json.loads(text)["episode"] for text in lines] == [0, 1]
    assert json.loads(lines[0])["metrics"] == results[0].metrics


def test_results_are_not_overwritten_unasked(tmp_path, results):
    with ResultFolder(tmp_path, RECORD) as folder:
        folder.append(results)
    before = (tmp_path / EPISODES).read_bytes()
    with pytest.raises(ValueError, match=re.escape(str(tmp_path)) + r" already holds results; .* --overwrite"):
        ResultFolder(tmp_path, RECORD)
    assert (tmp_path / EPISODES).read_bytes() == before


def test_overwrite_removes_the_old_run_and_nothing_else(tmp_path, results):
    for name in (SUMMARY, EPISODES, "plot_episode_old.png", "notes.txt", "photo.png"):
        (tmp_path / name).write_text("old")
    with ResultFolder(tmp_path, RECORD, overwrite=True) as folder:
        folder.append(results[:1])
    assert sorted(file.name for file in tmp_path.iterdir()) == [EPISODES, "notes.txt", "photo.png", RUN]
    assert len((tmp_path / EPISODES).read_text().splitlines()) == 1


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(ValueError, match="is a file; allowed: a folder"):
        ResultFolder(tmp_path / "out", RECORD)


def test_atomic_write_leaves_the_old_file_when_it_fails(tmp_path, monkeypatch):
    target = tmp_path / "summary.json"
    write_atomic(target, "old")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_atomic(target, "new")
    assert [file.name for file in tmp_path.iterdir()] == ["summary.json"]
    assert target.read_text() == "old"
    monkeypatch.undo()
    for wrong in (tmp_path / "nowhere" / "a.json", tmp_path):  # no such folder; a folder in the file's place
        with pytest.raises(OSError) as error:
            write_atomic(wrong, "new")
        assert error.value.filename == str(wrong) and ".tmp" not in str(error.value)
    assert [file.name for file in tmp_path.parent.iterdir() if file.name.endswith(".tmp")] == []


def test_what_a_killed_writer_left_is_written_over(tmp_path):
    (tmp_path / ".summary.json.tmp").write_text("half of it, and longer than the new")
    write_atomic(tmp_path / "summary.json", "new")
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("summary.json", "new")]


def test_numbers_that_json_lacks_are_refused():
    with pytest.raises(ValueError, match="JSON"):
        line("a", 0, math.nan).to_json()


def test_marks_need_episodes_and_something_to_see():
    """The same advantage of 0.1 m in every episode: a mark from ten on; of 0.4 % of the error, none at any number."""

    def verdict(episodes, more):
        errors = np.random.default_rng(5).uniform(4.0, 6.0, episodes)
        lines = [line("a", i, error) for i, error in enumerate(errors)]
        lines += [line("b", i, error + more) for i, error in enumerate(errors)]
        summary = summarise(SUITE, lines, ["a", "b"])
        return summary["scenarios"][0]["policies"][1]["verdict"]["rms_lateral_error"], caption(summary)

    assert verdict(9, 0.1)[0] == "tie" and "from 10 episodes on, marks say" in verdict(9, 0.1)[1]
    assert verdict(10, 0.1)[0] == "worse" and "▼ worse than a" in verdict(10, 0.1)[1]
    assert verdict(200, 0.02)[0] == "tie"


def test_episodes_are_won_by_who_errs_least_and_does_not_fail():
    """Of four episodes a wins one, b one, both tie in one, and a fails in the last, in which it errs less."""
    a, b = [1.0, 2.0, 1.5, 0.1], [2.0, 1.0, 1.5, 3.0]
    lines = [line("a", i, error, failed=i == 3) for i, error in enumerate(a)]
    lines += [line("b", i, error) for i, error in enumerate(b)]
    first, second = summarise(SUITE, lines, ["a", "b"])["scenarios"][0]["policies"]
    assert first["won"]["value"] == pytest.approx(1.5 / 4) and second["won"]["value"] == pytest.approx(2.5 / 4)


def test_middles_stand_beside_the_mean(results):
    """A car that spins rules the mean alone."""
    spun = [replace(one, metrics=one.metrics | {"rms_lateral_error": 1e6}) if one.episode == 7 else one
            for one in results if one.policy == "a"]  # fmt: skip
    (row,) = summarise(SUITE, spun, ["a"])["scenarios"][0]["policies"]
    numbers = [one.metrics["rms_lateral_error"] for one in spun]
    assert row["metrics"]["rms_lateral_error"]["value"] > 1e4
    assert row["median"]["rms_lateral_error"] == pytest.approx(np.median(numbers))
    assert row["interquartile_mean"]["rms_lateral_error"]["value"] == pytest.approx(stats.trim_mean(numbers, 0.25))


def test_what_was_trained_has_a_probability_of_improvement():
    """Three seeds, of which two return more than the reference: two of three pairs."""
    lines = [line("ref", i, 3.0) for i in range(10)]
    for seed, value in enumerate((4.0, 2.0, 5.0)):
        lines += [line(f"ppo-seed{seed}", i, value) for i in range(10)]
    summary = summarise(SUITE, lines, ["ref", "ppo-seed0", "ppo-seed1", "ppo-seed2"])
    assert summary["improvement"]["ppo (3 seeds)"]["value"] == pytest.approx(2 / 3)
    assert "| ppo (3 seeds) | 66.7<br>" in markdown(summary)
    assert summarise(SUITE, lines[:10], ["ref"])["improvement"] == {}


def test_of_many_policies_pictures_show_the_reference_ones_own_and_the_best():
    """The best ones by the mean place over scenarios; one that mostly fails comes after all that do not."""
    policies = ["worst", "mine.py:Mine", *(f"p{k}" for k in range(10))]
    errors = [9.0, 8.0, *(1.0 + 0.1 * k for k in range(10))]
    lines = []
    for policy, error in zip(policies, errors, strict=True):
        lines += [line(policy, i, error, failed=policy == "p0") for i in range(4)]
    shown = interesting(summarise(SUITE, lines, policies))
    assert shown == ["worst", "mine.py:Mine", *(f"p{k}" for k in range(1, 7))]
    looks = styles(policies, shown)
    assert len({(look["color"], look.get("marker")) for look in looks.values()}) == 9
    assert [look["label"] for name, look in looks.items() if name not in shown] == ["4 others", None, None, None]


def test_failed_episodes_are_listed_with_the_command_that_shows_them(results):
    assert failures(results[:20]) == ""
    text = failures(results)
    assert text.endswith("| scenario | b | 3 |\n") and "lanekeep play --run FOLDER" in text
    many = failures([line("a", k, 1.0, failed=True) for k in reversed(range(30))])
    assert many.endswith(f"| scenario | a | {', '.join(map(str, range(20)))}, … |\n")
