"""`lanekeep warmup`, and what a person is told of a first step that compiles."""

import json
import os
import subprocess
import sys

import pytest

from lanekeep_benchmarks import cli

TWO_KERNELS = """
from lanekeep_env.compile import kernel
@kernel()
def one(x):
    return x + 1
@kernel()
def other(x):
    return x - 1
one(1), other(1)
"""


def test_a_first_step_after_it_compiles_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LANEKEEP_CACHE_DIR", str(tmp_path))
    code = "import sys; from lanekeep_benchmarks import cli; sys.exit(cli.run(sys.argv[1:]))"
    words = [sys.executable, "-c", code, "warmup", "ReversePath-v0", "--dtype", "float32", "--json"]
    first = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    files = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.nbc")}
    again = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    assert files and files == {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.nbc")}
    assert first["folder"] == str(tmp_path) and first["first_steps"][0]["id"] == "lanekeep/ReversePath-v0"
    assert again["first_steps"][0]["seconds"] < 0.5 * first["first_steps"][0]["seconds"]


@pytest.mark.parametrize(("words", "told"), [(["LaneKep-v0"], "LaneKeep"), (["--dtype", "float16"], "float32")])
def test_what_is_wrong_is_one_line(words, told, capsys):
    assert cli.run(["warmup", *words]) != 0
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="terminals")
def test_a_person_is_told_once_and_a_file_is_not(tmp_path):
    pty = pytest.importorskip("pty")
    environment = {**os.environ, "LANEKEEP_CACHE_DIR": str(tmp_path)}
    heard = []
    for _ in range(2):
        ours, theirs = pty.openpty()
        done = subprocess.run([sys.executable, "-c", TWO_KERNELS], env=environment, stderr=theirs, capture_output=False)
        os.close(theirs)
        try:
            text = os.read(ours, 65536).decode()
        except OSError:  # nobody wrote
            text = ""
        os.close(ours)
        assert done.returncode == 0
        heard.append(text)
    assert heard[0].count("lanekeep: compiling") == 1 and "warmup" in heard[0] and heard[1] == ""
    environment["LANEKEEP_CACHE_DIR"] = str(tmp_path / "another")
    done = subprocess.run([sys.executable, "-c", TWO_KERNELS], env=environment, capture_output=True, text=True)
    assert done.stderr == ""
