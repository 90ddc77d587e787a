"""Resuming: torn ends are dropped, foreign results refused by name, and the end is that of an unbroken run."""

import errno
import json
import math
import os
import shutil

import numpy as np
import pytest

import lanekeep_env
from lanekeep_benchmarks import runs
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.results import EPISODES, ResultFolder
from lanekeep_benchmarks.run_record import RUN
from lanekeep_benchmarks.suites import SUITES, Suite, SuiteScenario

_SHORT: dict = {"departure": "cost", "preview": 1}
SUITE = Suite(
    "short",
    "two short scenarios",
    (
        SuiteScenario("slalom", "A slalom", {"road": "slalom", **_SHORT}, max_episode_steps=30),
        SuiteScenario("circle", "A circle", {"road": "circle", **_SHORT}, max_episode_steps=30),
    ),
    episodes=4,
)
BENCH = ["bench", "short", "--policies", "pd,yin-lqr"]
TOTAL = 16


@pytest.fixture(autouse=True)
def short_suite(monkeypatch):
    monkeypatch.setitem(SUITES, "short", SUITE)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """Folder of a run that nothing stopped."""
    folder = tmp_path_factory.mktemp("unbroken") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SUITES, "short", SUITE)
        assert main([*BENCH, "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def killed(unbroken, tmp_path):
    """What is left of it when it is killed while it writes its seventh line."""
    folder = tmp_path / "killed"
    folder.mkdir()
    shutil.copy(unbroken / RUN, folder)
    lines = (unbroken / EPISODES).read_bytes().splitlines(keepends=True)
    (folder / EPISODES).write_bytes(b"".join(lines[:6]) + lines[6][:50])
    return folder


def contents(folder):
    """Every file's bytes, the result lines as a sorted list."""
    found = {file.name: file.read_bytes() for file in folder.rglob("*.*")}
    return {name: sorted(data.splitlines()) if name == EPISODES else data for name, data in found.items()}


def resume(folder, *options):
    return main(["bench", "--resume", "--out", str(folder), *options])


def refusal(folder, capsys, *options):
    """The one line that refuses to resume; the folder stays as it is."""
    before = contents(folder)
    assert resume(folder, *options) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and captured.out == ""
    assert contents(folder) == before
    return captured.err


def test_a_resumed_run_leaves_the_files_of_an_unbroken_one(killed, unbroken, capsys):
    """Lines, summary, tables and every picture, to the last byte; options left out are those of the run."""
    assert resume(killed) == 0
    assert contents(killed) == contents(unbroken)
    error = capsys.readouterr().err
    assert error == f"lanekeep: 6 of {TOTAL} episodes are in {killed}, a torn last line was dropped\n"


def test_a_complete_run_gets_its_report_again_and_drives_nothing(unbroken, tmp_path, capsys, monkeypatch):
    folder = tmp_path / "run"
    shutil.copytree(unbroken, folder)
    for file in [*folder.glob("*.png"), folder / "summary.md"]:
        file.unlink()
    monkeypatch.setattr("lanekeep_benchmarks.evaluate.Measured", None)
    assert resume(folder) == 0
    assert contents(folder) == contents(unbroken)
    assert f"{TOTAL} of {TOTAL} episodes" in capsys.readouterr().err


def test_torn_anywhere(unbroken, tmp_path):
    """The file of lines cut at any byte: whole lines stay, the rest is driven, and the lines are the same."""
    content = (unbroken / EPISODES).read_bytes()
    first = content.index(b"\n")
    cuts = np.random.default_rng(0).integers(0, len(content), 12).tolist()
    for cut in [0, first, first + 1, first + 2, len(content) - 1, len(content), *cuts]:
        folder = tmp_path / str(cut)
        folder.mkdir()
        shutil.copy(unbroken / RUN, folder)
        (folder / EPISODES).write_bytes(content[:cut])
        plan, opened = runs.open_run(runs.Options(out=folder, resume=True))
        assert opened.torn == (cut > 0 and content[cut - 1 : cut] != b"\n")
        assert len(plan.results) == content[:cut].count(b"\n")
        with opened:
            driven = sum(count for _, count in runs.drive(plan, opened))
        assert driven == TOTAL - content[:cut].count(b"\n")
        assert sorted((folder / EPISODES).read_bytes().splitlines()) == sorted(content.splitlines())
        assert len(plan.results) == TOTAL


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--seed", "1"], ["seed is 0 there, 1 wanted", "leave --seed out"]),
        (["--episodes", "5"], ["episodes is 4 there, 5 wanted", "leave --episodes out"]),
        (["--policies", "yin-lqr,pd"], ["policies is ['pd', 'yin-lqr'] there", "leave --policies out"]),
        (["classical"], ["suite is 'short' there, 'classical' wanted", "leave the suite and --road out"]),
        (["--seed", "1", "--episodes", "5"], ["seed is 0 there", "episodes is 4 there"]),
    ],
)
def test_other_options_are_refused_by_name(killed, options, words, capsys):
    error = refusal(killed, capsys, *options)
    assert all(word in error for word in [str(killed), "--overwrite", *words])


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        (
            "version",
            "0.0.9",
            [f"version is '0.0.9' there, '{lanekeep_env.__version__}' wanted", "install that version"],
        ),
        ("code", "0123", ["code is '0123' there", "restore lanekeep_env, lanekeep_baselines"]),
        ("scenario_hash", {"slalom": "0123"}, ["scenario_hash of slalom is '0123' there", "restore the scenario"]),
    ],
)
def test_another_lanekeep_or_scenario_is_refused_by_name(killed, field, value, words, capsys):
    record = json.loads((killed / RUN).read_text())
    (killed / RUN).write_text(json.dumps(record | {field: value}))
    error = refusal(killed, capsys)
    assert all(word in error for word in [str(killed), "--overwrite", *words])


def test_a_changed_scenario_is_refused(killed, capsys, monkeypatch):
    """The scenario of that name is now another one: its hash says so."""
    slalom, circle = SUITE.scenarios
    longer = SuiteScenario("circle", circle.title, {**circle.keywords, "lane_width": 3.0}, max_episode_steps=30)
    monkeypatch.setitem(SUITES, "short", Suite("short", "changed", (slalom, longer), 4))
    assert "scenario_hash of circle is " in refusal(killed, capsys)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 3}, "seed is 3 there, 0 wanted"),
        ({"version": "0.0.9"}, "version is '0.0.9' there"),
        ({"suite": "classical"}, "suite is 'classical' there, 'short' wanted"),
        ({"scenario": "yin-b"}, "'that of slalom or circle' wanted"),
        ({"scenario_hash": "0123"}, "scenario_hash is '0123' there"),
        ({"policy": "wild"}, "policy is 'wild' there, 'pd or yin-lqr' wanted"),
        ({"episode": 4}, "episode is 4 there, '0 to 3' wanted"),
        ({"episode_seed": 1}, "episode_seed is 1 there"),
        ({"episode": 0, "episode_seed": None}, "repeats slalom, pd, episode 0"),
        ({"sead": 1}, "is not a result line (result line has no field 'sead' (did you mean 'seed'?)"),
        ({"metrics": {"return": 1.0}}, "metrics.rms_lateral_error is 'missing' there, 'a number' wanted; metrics.peak"),
        ({"metrics": {}}, "metrics.peak_lateral_error is 'missing' there"),
        ({"metrics": {"lap_time": 1.0}}, "metrics.lap_time is 'a number' there, 'none' wanted"),
        ({"metrics": {"retrun": 1.0}}, "metrics='retrun' is unknown (did you mean 'return'?)"),
        ({"metrics": [1.0]}, "metrics=[1.0] is not allowed: it must be a mapping"),
        ({"metrics": {"return": "1"}}, "metrics.return='1' is not allowed: it must be a finite number"),
        ({"metrics": {"return": 10**400}}, "metrics.return=<an integer of 400 digits> is not allowed"),
        ({"metrics": {"return": math.nan}}, "is not a result line (NaN is not allowed"),
        ({"metrics": {"return": 1e300}}, "and <= 1e+50"),
        ({"episode": 1.0}, "episode=1.0 is not allowed: it must be a whole number"),
        ({"episode": True}, "episode=True is not allowed"),
        ({"episode": 10**400}, "episode is <an integer of 400 digits> there, '0 to 3' wanted"),
        ({"failed": 0}, "failed=0 is not allowed: it must be true or false"),
        ({"steps": 0}, "steps=0 is not allowed"),
        ({"steps": 10**400}, "steps=<an integer of 400 digits> is not allowed"),
        ({"policy": ["pd"]}, "policy=['pd'] is not allowed: it must be a text"),
        ({"policy": "x" * 30_000}, "policy is 'xxxx"),
        ({"scenario": None}, "scenario=None is not allowed: it must be a text"),
        ({"version": {}}, "version={} is not allowed"),
    ],
)
def test_a_foreign_line_is_refused_by_its_number(killed, change, words, capsys):
    first, second, *rest = (killed / EPISODES).read_text().splitlines(keepends=True)
    line = json.loads(second) | change
    if line["episode_seed"] is None:
        line["episode_seed"] = json.loads(first)["episode_seed"]
    (killed / EPISODES).write_text(first + json.dumps(line) + "\n" + "".join(rest))
    error = refusal(killed, capsys)
    assert f"{killed / EPISODES} line 2 " in error and words in error


@pytest.mark.parametrize(
    "garbage",
    [
        *(b"\0" * 40, b'{"suite": "sh', b"3", b"[]", b'"text"', b"\xff\xfe", b"", b"[" * 60_000, b"9" * 5000),
        b'{"suite": "short", "suite": "short"}',
    ],
)
def test_garbage_between_lines_is_refused(killed, garbage, capsys):
    first, *rest = (killed / EPISODES).read_bytes().splitlines(keepends=True)
    (killed / EPISODES).write_bytes(first + garbage + b"\n" + b"".join(rest))
    assert "line 2 is not a result line" in refusal(killed, capsys)


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"version": 1', "null"])
def test_a_broken_record_is_refused(killed, content, capsys):
    (killed / RUN).write_text(content)
    assert f"{killed / RUN} is not the record of a run" in refusal(killed, capsys)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"episodes": 10**400}, "episodes=<an integer of 400 digits> is not allowed"),
        ({"episodes": 4.0}, "episodes=4.0 is not allowed: it must be a whole number"),
        ({"seed": "0"}, "seed='0' is not allowed"),
        ({"policies": "pd"}, "policies='pd' is not allowed: it must be a list of texts"),
        ({"policies": ["pd", "pd"]}, "the texts must differ"),
        ({"policies": []}, "policies=[] is not allowed"),
        ({"scenario_hash": {"slalom": 3}}, "scenario_hash of 'slalom'=3 is not allowed: it must be a text"),
        ({"scenario_hash": []}, "scenario_hash=[] is not allowed: it must be a mapping"),
        ({"metrics": {"slalom": ["return"]}}, "metrics of slalom is ['return'] there"),
        ({"road": 3}, "road=3 is not allowed"),
        ({"suite": "x" * 100_000}, "suite 'xxx"),
        ({"sead": 1}, "has no field 'sead' (did you mean 'seed'?)"),
        ({"version": ["x" * 100_000]}, "version is ['xxx"),
        ({f"x{k}": k for k in range(200_000)}, "bytes, allowed are 1048576"),
    ],
)
def test_a_record_with_something_else_in_it_is_refused(killed, change, words, capsys):
    record = json.loads((killed / RUN).read_text())
    (killed / RUN).write_text(json.dumps(record | change))
    error = refusal(killed, capsys)
    assert words in error and len(error) < 1500


@pytest.mark.parametrize("end", [b"x", b'{"suite": "' + b"x" * 70_000, b"\0x", b"\n\n{"])
def test_an_end_that_no_run_leaves_is_refused(killed, end, capsys):
    content = (killed / EPISODES).read_bytes()
    (killed / EPISODES).write_bytes(content[: content.rindex(b"\n") + 1] + end)
    assert f"{killed / EPISODES} line 7 " in refusal(killed, capsys)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes")
@pytest.mark.parametrize("name", [RUN, EPISODES, "summary.json", "summary.md", "plot_errors.png"])
@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "link"])
def test_what_is_no_file_is_refused_at_once(killed, name, kind, tmp_path, capsys):
    victim = tmp_path / "victim"
    victim.write_bytes(b"mine")
    (killed / name).unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(killed / name)
    elif kind == "folder":
        (killed / name).mkdir()
    else:
        (killed / name).symlink_to("/dev/zero" if kind == "device" else victim)
    for options in (["--resume"], ["--overwrite"]):
        if name == RUN and options == ["--resume"] and kind == "link":
            continue  # it is read, as one that is not the record of a run
        assert main([*BENCH, "--out", str(killed), *options]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "not an ordinary file" in error and str(killed / name) in error
    assert victim.read_bytes() == b"mine" and os.path.lexists(killed / name)
    assert not (killed / ".run.json.tmp").exists()


def test_lines_without_a_record_are_refused(killed, capsys):
    (killed / RUN).unlink()
    assert f"no {RUN}" in refusal(killed, capsys, *BENCH[1:])


def test_nothing_to_resume_is_a_start(tmp_path, unbroken, capsys):
    """A run killed before its first line, even before its folder: the same command with --resume completes it."""
    assert resume(tmp_path / "out", *BENCH[1:]) == 0
    assert f"0 of {TOTAL} episodes are in {tmp_path / 'out'}\n" in capsys.readouterr().err
    assert contents(tmp_path / "out") == contents(unbroken)


def test_resume_needs_a_folder_and_keeps_results(killed, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "--resume"]) == 2
    assert "--resume needs --out" in capsys.readouterr().err
    assert "exclude each other" in refusal(killed, capsys, "--overwrite")


def test_without_resume_the_folder_is_refused(killed, capsys):
    before = contents(killed)
    assert main([*BENCH, "--out", str(killed)]) == 2
    assert "already holds results" in capsys.readouterr().err
    assert contents(killed) == before


def test_overwrite_after_another_run(killed, unbroken):
    """What another run left, torn line and all, is gone."""
    (killed / RUN).write_text("{}")
    assert main([*BENCH, "--out", str(killed), "--overwrite"]) == 0
    assert contents(killed) == contents(unbroken)


def test_a_road_of_ones_own_is_resumed(tmp_path, capsys):
    """The road is in the record; an edited file is another scenario."""
    road, out = tmp_path / "bend.csv", tmp_path / "out"
    angle = np.linspace(0.0, 1.5, 80)
    points = np.stack([90 * np.sin(angle), 90 - 90 * np.cos(angle)], axis=1)
    np.savetxt(road, points, fmt="%.4f", delimiter=",")
    assert main(["bench", "--road", str(road), "--policies", "pd", "--episodes", "2", "--out", str(out)]) == 0
    whole = contents(out)
    (out / EPISODES).write_bytes(whole[EPISODES][0] + b"\n")
    assert resume(out) == 0
    assert contents(out) == whole
    capsys.readouterr()
    np.savetxt(road, 1.01 * points, fmt="%.4f", delimiter=",")
    assert "scenario_hash of bend is " in refusal(out, capsys)


def test_two_processes_never_write_one_folder(killed, capsys):
    pytest.importorskip("fcntl")
    _, opened = runs.open_run(runs.Options(out=killed, resume=True))
    with opened:
        assert "another process is writing there" in refusal(killed, capsys)
        assert main([*BENCH, "--out", str(killed), "--overwrite"]) == 2
    assert resume(killed) == 0


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "lanekeep: interrupted; to complete"),
        (OSError(errno.ENOSPC, "No space left on device"), 1, "No space left on device; to complete"),
    ],
)
def test_a_stopped_run_says_how_to_resume(unbroken, tmp_path, error, code, words, capsys, monkeypatch):
    """The line's command, as it stands, completes the run."""
    append, chunks = ResultFolder.append, []

    def stop_at_the_third(self, results):
        chunks.append(results)
        if len(chunks) == 3:
            raise error
        append(self, results)

    out = tmp_path / "my results"
    monkeypatch.setattr(ResultFolder, "append", stop_at_the_third)
    assert main([*BENCH, "--out", str(out)]) == code
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and captured.out == ""
    assert words in captured.err
    assert captured.err.endswith(f" the run: lanekeep bench --resume --out '{out}'\n")
    assert resume(out) == 0
    assert contents(out) == contents(unbroken)
    assert capsys.readouterr().err.startswith(f"lanekeep: 8 of {TOTAL} episodes")


def test_ctrl_c_anywhere_else_is_one_line(capsys, monkeypatch, tmp_path):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(runs, "make_plan", interrupt)
    assert main([*BENCH, "--out", str(tmp_path / "out")]) == 130
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "lanekeep: interrupted\n")
    assert not (tmp_path / "out").exists()
