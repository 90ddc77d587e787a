"""The command line from the outside: output, files, exit codes, one-line errors."""

import io
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

import lanekeep_baselines
import lanekeep_env
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.cli import app
from lanekeep_benchmarks.metrics import METRICS

RUNNER = CliRunner()
BENCH = ["bench", "--policies", "pd,yin-lqr", "--episodes", "3"]


@pytest.fixture
def oval(tmp_path):
    """A closed centre line: two straights of 200 m and two half circles of 80 m radius."""
    turn = np.linspace(0.0, math.pi, 60, endpoint=False)
    straight = np.linspace(0.0, 200.0, 40, endpoint=False)
    x = np.concatenate([straight, 200 + 80 * np.sin(turn), 200 - straight, -80 * np.sin(turn)])
    y = np.concatenate([0 * straight, 80 - 80 * np.cos(turn), 160 + 0 * straight, 80 + 80 * np.cos(turn)])
    file = tmp_path / "oval.csv"
    file.write_text("# x_m, y_m\n" + "".join(f"{a:.4f}, {b:.4f}\n" for a, b in zip(x, y, strict=True)))
    return file


@pytest.mark.parametrize("command", ["envs", "bench", "speed", "train", "tune"])
def test_help_shows_an_example(command):
    result = RUNNER.invoke(app, [command, "--help"])
    assert result.exit_code == 0
    assert f"Example: lanekeep {command}" in result.output


def test_envs_lists_every_id_with_its_channels():
    assert all(env_id in RUNNER.invoke(app, ["envs"]).output for env_id in lanekeep_env.ENVIRONMENTS)
    found = json.loads(RUNNER.invoke(app, ["envs", "--json"]).stdout)
    assert [entry["id"] for entry in found] == sorted(lanekeep_env.ENVIRONMENTS)
    lane_keep = next(entry for entry in found if "LaneKeep" in entry["id"])
    channels = {channel["name"]: channel for channel in lane_keep["channels"]}
    assert channels["lateral_error"]["unit"] == "m"
    # Every keyword says what it means, and no two the same.
    for entry in found:
        meanings = [keyword["meaning"] for keyword in entry["keywords"]]
        assert all(meanings) and len(set(meanings)) == len(meanings), entry["id"]
    one = " ".join(
        re.sub("[│┃]", " ", RUNNER.invoke(app, ["envs", "LaneKeep-v0"], env={"COLUMNS": "160"}).output).split()
    )
    assert "curvature samples in the observation" in one and "yaw_rate" in one and "Circuit" not in one


@pytest.mark.parametrize("width", [60, 80, 120])
def test_tables_fit_the_terminal_and_never_cut_a_number(finished, width, monkeypatch):
    """Every number that is shown is one of the summary, and no line is longer than the terminal."""
    from lanekeep_benchmarks.report import cells, terminal_table
    from lanekeep_benchmarks.summary import columns_of

    folder, _ = finished
    summary = json.loads((folder / "summary.json").read_text())
    monkeypatch.setenv("COLUMNS", str(width))
    for entry in summary["scenarios"]:
        console = Console(width=width, record=True, file=io.StringIO())
        console.print(terminal_table(entry, summary["reference"], width))
        text = console.export_text()
        assert max(map(len, text.splitlines())) <= width and "\N{HORIZONTAL ELLIPSIS}\u2502" not in text
        rows = [cells(row, columns_of(entry["policies"])) for row in entry["policies"]]
        known = {part for row in rows for cell in row for part in cell}
        shown = re.findall(r"(?<![\w.\[/])[+-]?\d+\.\d+(?:…[+-]?\d+\.\d+)?(?: [▲▼])?", text.partition("┡")[2])
        assert shown and all(number.strip() in known for number in shown), set(shown) - known
        assert len(shown) >= 4 * len(rows)
        words = re.sub(r"[│┃┏┓┳━┡╇┩]", " ", text.partition("┡")[0]).split()
        for heading in ("failure", "lateral", "policy"):  # no word of a heading is cut either
            assert heading in words and not any(word.endswith("…") for word in words)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """One short run of the default suite: (folder, terminal output)."""
    folder = tmp_path_factory.mktemp("bench") / "run"
    result = RUNNER.invoke(app, [*BENCH, "--out", str(folder)])
    assert result.exit_code == 0, result.output
    return folder, result.output


def test_bench_writes_lines_summary_tables_and_plots(finished):
    folder, output = finished
    lines = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    summary = json.loads((folder / "summary.json").read_text())
    assert len(lines) == len(summary["scenarios"]) * 2 * 3
    assert {line["version"] for line in lines} == {lanekeep_env.__version__}
    assert set(lines[0]["metrics"]) < set(METRICS)
    for scenario in summary["scenarios"]:
        picture = (folder / f"plot_episode_{scenario['scenario']}.png").read_bytes()
        assert picture.startswith(b"\x89PNG") and len(picture) > 20_000
        mine = [line for line in lines if (line["scenario"], line["policy"]) == (scenario["scenario"], "yin-lqr")]
        mean = np.mean([line["metrics"]["rms_lateral_error"] for line in mine])
        assert scenario["policies"][1]["metrics"]["rms_lateral_error"]["value"] == pytest.approx(mean)
        assert scenario["title"] in output
    for picture in ("plot_errors.png", "plot_profiles.png"):
        assert (folder / picture).stat().st_size > 20_000
    assert "| yin-lqr |" in (folder / "summary.md").read_text()
    assert str(folder) in output


@pytest.mark.usefixtures("unpainted")
def test_bench_repeats_itself(finished, tmp_path):
    folder, _ = finished
    assert main([*BENCH, "--out", str(tmp_path / "again")]) == 0
    for name in ("episodes.jsonl", "summary.json", "summary.md"):
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes()


@pytest.mark.usefixtures("unpainted")
def test_bench_refuses_to_overwrite_and_does_so_when_told(finished, capsys):
    folder, _ = finished
    assert main([*BENCH, "--out", str(folder)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert str(folder) in error and "--overwrite" in error
    assert main(["bench", "--policies", "pd", "--episodes", "1", "--out", str(folder), "--overwrite"]) == 0
    lines = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    assert {line["policy"] for line in lines} == {"pd"}


def test_bench_on_a_road_of_ones_own_drives_a_whole_lap(oval, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["--road", str(oval), "--episodes", "2", "--policies", "yin-lqr-feedforward", "--json"]
    assert main(["bench", *arguments, "--out", str(out)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["folder"] == str(out)
    (scenario,) = summary["scenarios"]
    length = 400 + 2 * math.pi * 80
    radius_speed = math.sqrt(0.4 * 9.81 * 80)
    assert scenario["max_episode_steps"] * 0.05 == pytest.approx(length / radius_speed, rel=0.25)
    assert scenario["policies"][0]["failures"] == 0
    assert {file.name for file in out.glob("*.png")} == {
        "plot_errors.png",
        "plot_episode_oval.png",
        "plot_map_oval.png",
        "plot_profiles.png",
    }


TRACKS = Path(__file__).parents[3] / "shared" / "data" / "tracks"


@pytest.mark.skipif(not TRACKS.is_dir(), reason="the tracks are not shipped with the project")
@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("track", ["Hockenheim", "Spielberg"])
def test_real_tracks(track, tmp_path, capsys):
    """A whole lap of hairpins: the feedforward stays in its lane, and no policy is short of steering angle."""
    arguments = ["--policies", "yin-lqr-observer,yin-lqr-feedforward", "--episodes", "2", "--json"]
    assert main(["bench", "--road", str(TRACKS / f"{track}.csv"), *arguments, "--out", str(tmp_path / "out")]) == 0
    observer, feedforward = json.loads(capsys.readouterr().out)["scenarios"][0]["policies"]
    assert feedforward["failures"] == 0
    assert feedforward["metrics"]["rms_lateral_error"]["value"] < 0.15
    assert observer["metrics"]["rms_lateral_error"]["value"] < 0.7


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["bench", "clasical"], ["'clasical'", "did you mean 'classical'"]),
        (["bench", "--policies", "yin-lrq"], ["'yin-lrq'", "did you mean 'yin-lqr'"]),
        (["bench", "drive", "--policies", "werling"], ["'werling' is unknown", "allowed: werling-drive, "]),
        (["bench", "--policies", "pd,pd"], ["'pd, pd'", "different names"]),
        (["bench", "--policies", ","], ["''", "one or more"]),
        (["bench", "--policies", ""], ["''", "one or more"]),
        (["bench", "--episodes", "0"], ["--episodes", "0", ">= 1"]),
        (["bench", "--episodes", "-3"], ["--episodes", "-3", ">= 1"]),
        (["bench", "--episodes", "many"], ["--episodes", "integer"]),
        (["bench", "--seed", "-1"], ["--seed", "-1"]),
        (["bench", "--road", "no/such.csv"], ["no/such.csv", "no such file"]),
        (["bench", "classical", "--road", "no/such.csv"], ["exclude each other"]),
        (["bench", "--frobnicate"], ["--frobnicate"]),
        (["frobnicate"], ["frobnicate"]),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("lanekeep: ")
    assert all(word in captured.err for word in words)
    assert captured.out == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("content", "words"),
    [("", ["empty.csv"]), ("x,y\n0,0\n1,one\n", ["empty.csv", "one"]), ("0,0\n1,0\n", ["empty.csv"])],
)
def test_a_bad_road_file_is_named(content, words, capsys, tmp_path):
    file = tmp_path / "empty.csv"
    file.write_text(content)
    assert main(["bench", "--road", str(file), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert all(word in error for word in words)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("unpainted")
def test_a_road_of_ones_own_has_the_widths_of_its_file_and_its_smoothing(oval, tmp_path, capsys, monkeypatch):
    """The lane is twice the narrowest side; the smoothing is part of the scenario, and a resumed run keeps it."""
    monkeypatch.chdir(tmp_path)
    rows = oval.read_text().splitlines()[1:]
    oval.write_text("x_m,y_m,w_tr_right_m,w_tr_left_m\n" + "".join(f"{row}, 2.5, 2.25\n" for row in rows))
    hashes = []
    for out, options in (("plain", []), ("smooth", ["--smoothing", "0.02"])):
        command = ["bench", "--road", str(oval), "--policies", "stanley", "--episodes", "1", "--json"]
        assert main([*command, "--out", out, *options]) == 0
        captured = capsys.readouterr()
        (scenario,) = json.loads(captured.out)["scenarios"]
        assert scenario["keywords"]["lane_width"] == "file"
        assert scenario["keywords"]["road"].get("smoothing") == (0.02 if options else None)
        assert all(line.startswith("lanekeep: ") for line in captured.err.splitlines())
        hashes.append(scenario["scenario_hash"])
        assert main(["bench", "--resume", "--out", out, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["scenarios"][0]["scenario_hash"] == scenario["scenario_hash"]
    assert hashes[0] != hashes[1]
    assert main(["bench", "classical", "--smoothing", "1"]) == 2
    assert "--smoothing 1.0 has no effect without --road" in capsys.readouterr().err


def command(*arguments, **keywords):
    """The command in a process of its own."""
    run = [sys.executable, "-m", "lanekeep_benchmarks", *arguments]
    return subprocess.run(run, capture_output=True, text=True, **keywords)


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_an_output_that_nobody_reads_and_a_folder_that_nobody_can_write(tmp_path, monkeypatch, capsys):
    read, write = os.pipe()
    os.close(read)
    run = [sys.executable, "-m", "lanekeep_benchmarks", "envs"]
    done = subprocess.run(run, stdout=write, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1 and done.stderr == "lanekeep: what reads the output was closed before its end\n"
    for command_line in (["envs", "Drive-v0"], ["envs", "--json"], ["--version"]):
        with open("/dev/full", "w") as full:
            done = subprocess.run([*run[:3], *command_line], stdout=full, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 1
        assert done.stderr == "lanekeep: the output cannot be written: No space left on device\n"
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "--policies", "stanley", "--episodes", "1", "--out", "/proc/nowhere"]) == 2
    assert capsys.readouterr().err == "lanekeep: /proc/nowhere: No such file or directory\n"
    road = tmp_path / "road.csv"
    road.write_text("x_m,y_m\n" + "".join(f"{x},0\n" for x in range(0, 100, 5)))
    picture = tmp_path / "nowhere" / "road.png"  # by its own name, not that of the file beside it
    assert main(["road", "check", str(road), "--out", str(picture)]) == 2
    assert capsys.readouterr().err == f"lanekeep: --out {picture}: there is no folder {picture.parent}\n"
    road.unlink()
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="displays")
def test_a_window_needs_a_display(tmp_path):
    pytest.importorskip("pygame")
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    environment = {key: value for key, value in os.environ.items() if key not in hidden}
    done = command("play", "--human", "--seconds", "0.5", cwd=tmp_path, env=environment)
    assert done.returncode == 2 and "lanekeep: --human needs a display, and there is none" in done.stderr


def test_results_as_csv(finished, tmp_path, capsys):
    folder, _ = finished
    assert main(["export", str(folder), "--out", str(tmp_path / "csv")]) == 0
    said = capsys.readouterr().out
    found = (tmp_path / "csv" / "results.csv").read_text().splitlines()
    lines = (folder / "episodes.jsonl").read_text().splitlines()
    assert len(found) == 1 + len(lines) and f"results.csv: {len(lines)} rows" in said
    assert "rms_lateral_error" in found[0].split(",")
    assert main(["export", str(folder), "--out", str(tmp_path / "csv")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "--overwrite" in error
    (tmp_path / "file").write_text("kept")
    assert main(["export", str(folder), "--out", str(tmp_path / "file")]) == 2
    assert "file is a file; allowed: a folder" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "kept"


def test_missing_typer_names_the_extra(tmp_path):
    """A light installation has the command, but not what it needs."""
    (tmp_path / "typer.py").write_text("raise ModuleNotFoundError(\"No module named 'typer'\", name='typer')")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(
        [sys.executable, "-m", "lanekeep_benchmarks", "envs"], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr == 'lanekeep: typer is not installed; pip install "lanekeep[bench]"\n'


@pytest.mark.usefixtures("unpainted")
def test_all_baselines_that_can_drive_are_the_default(oval, tmp_path, capsys):
    assert main(["bench", "--road", str(oval), "--episodes", "1", "--json", "--out", str(tmp_path / "out")]) == 0
    policies = json.loads(capsys.readouterr().out)["scenarios"][0]["policies"]
    assert [row["policy"] for row in policies] == list(
        lanekeep_baselines.names(lanekeep_env.LaneKeepScenario(preview=12))
    )
