"""`lanekeep zoo --remake`: the command in each file, in a folder of its own, once."""

import shutil
from types import SimpleNamespace

import pytest

from lanekeep_benchmarks import remade
from lanekeep_benchmarks.cli import run
from lanekeep_benchmarks.policies import ZOO

NAME = "ppo-lane-keep-seed0"


@pytest.fixture
def commands(monkeypatch):
    """What was run; a run leaves the shipped files, without the command's minutes."""
    found = []

    def copy(command, **_):
        found.append(command)
        folder = command[command.index("--out") + 1]
        for end in (".json", ".safetensors"):
            shutil.copy(ZOO / f"{NAME}{end}", folder)
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(remade.subprocess, "run", copy)
    return found


def test_the_command_in_the_file_is_run_once(commands, tmp_path, capsys):
    for _ in range(2):
        assert run(["zoo", "--remake", NAME, "--out", str(tmp_path)]) == 0
        assert "the shipped weights to the last bit" in capsys.readouterr().out
    ((_, _, _, *words),) = commands
    assert words[:3] == ["train", "ppo", "lanekeep/LaneKeep-v0"] and "--resume" not in words
    assert words[-1] == str(tmp_path / NAME)


def test_a_run_that_was_stopped_goes_on(commands, tmp_path):
    (tmp_path / NAME).mkdir()
    (tmp_path / NAME / "settings.json").write_text("{}")
    assert run(["zoo", "--remake", NAME, "--out", str(tmp_path)]) == 0
    assert commands[0][-1] == "--resume"


def test_one_that_failed_is_not_taken_for_made(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(remade.subprocess, "run", lambda command, **_: SimpleNamespace(returncode=3))
    assert run(["zoo", "--remake", NAME, "--out", str(tmp_path)]) == 2
    assert "ended with 3" in capsys.readouterr().err
    assert not (tmp_path / NAME / remade.DONE).exists()


def test_a_name_that_is_none_is_refused(tmp_path, capsys):
    assert run(["zoo", "--remake", "ppo-lane-kep-seed0", "--out", str(tmp_path)]) == 2
    assert NAME in capsys.readouterr().err


def test_an_example_is_a_file_of_the_repository(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="checkout"):
        remade.command_of("ppo-highway-seed0", tmp_path)
