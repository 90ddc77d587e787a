"""Real processes, really killed: several times kill -9 in one run, and one Ctrl-C."""

import shlex
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from lanekeep_benchmarks.results import EPISODES, SUMMARY
from lanekeep_benchmarks.run_record import RUN

SUITE = """
name = "two"
description = "two roads"
episodes = 300
policies = ["pd", "yin-lqr"]

[[scenario]]
name = "random-roads"
title = "random roads"

[[scenario]]
name = "yin-b"
title = "two curves"
keywords = { road = "yin", start_lateral_error = 1.0 }
"""
# 300 episodes are two chunks: 2 scenarios x 2 policies x 2 chunks.
TOTAL = 1200

pytestmark = [pytest.mark.long, pytest.mark.skipif(sys.platform == "win32", reason="signals")]


def start(*arguments):
    command = [sys.executable, "-m", "lanekeep_benchmarks", "bench", *arguments]
    pipe = subprocess.PIPE
    # A shell that runs the tests in its background lets its children ignore Ctrl-C.
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, preexec_fn=listen_to_ctrl_c)


def listen_to_ctrl_c():
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def lines_in(folder):
    file = folder / EPISODES
    return file.read_bytes().count(b"\n") if file.exists() else 0


def wait_for_lines(process, folder, count):
    while lines_in(folder) < count and process.poll() is None:
        time.sleep(0.005)


def wait_for_file(process, file):
    while not file.exists() and process.poll() is None:
        time.sleep(0.005)


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """Path of a suite of two roads: as many as it takes to be killed between them."""
    file = tmp_path_factory.mktemp("suite") / "two.toml"
    file.write_text(SUITE)
    return str(file)


@pytest.fixture(scope="module")
def unbroken(suite, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kill") / "unbroken"
    process = start(suite, "--out", str(folder))
    _, error = process.communicate()
    assert process.returncode == 0, error
    assert lines_in(folder) == TOTAL
    return folder


def assert_same_results(folder, unbroken):
    assert {file.name for file in folder.rglob("*.*")} == {file.name for file in unbroken.rglob("*.*")}
    for file in unbroken.glob("*.*"):
        ours, theirs = (folder / file.name).read_bytes(), file.read_bytes()
        if file.name == EPISODES:
            ours, theirs = sorted(ours.splitlines()), sorted(theirs.splitlines())
        assert ours == theirs, file.name


@pytest.mark.parametrize("kills", [4, pytest.param(10, marks=pytest.mark.slow)])
def test_kill_9_at_random_moments(kills, suite, unbroken, tmp_path):
    """Once while it starts, then a random number of lines later, once in the report; then left alone."""
    generator = np.random.default_rng(2026)
    folder = tmp_path / "killed"
    before = 0
    for kill in range(kills):
        process = start(suite, "--out", str(folder), "--resume")
        if kill == 0:
            time.sleep(generator.uniform(0.0, 1.0))
        elif kill < kills - 1:
            fair_share = (TOTAL - before) // (kills - kill)
            wait_for_lines(process, folder, before + generator.integers(1, 2 * fair_share + 2))
        else:
            wait_for_file(process, folder / SUMMARY)
        time.sleep(generator.uniform(0.0, 0.05))
        process.kill()
        _, error = process.communicate()
        assert process.returncode == -signal.SIGKILL, error
        assert lines_in(folder) >= before  # a resumed run keeps what it finds
        before = lines_in(folder)
    assert before == TOTAL
    process = start("--resume", "--out", str(folder))
    _, error = process.communicate()
    assert process.returncode == 0, error
    assert_same_results(folder, unbroken)


def test_ctrl_c_ends_with_the_command_that_completes_the_run(suite, unbroken, tmp_path):
    folder = tmp_path / "interrupted"
    process = start(suite, "--out", str(folder))
    wait_for_lines(process, folder, 1)
    process.send_signal(signal.SIGINT)
    output, error = process.communicate()
    # Python ends by the signal itself where Ctrl-C has met an exec inside an import; a shell shows 130 for both.
    assert process.returncode in (130, -signal.SIGINT), error
    assert output == "" and error.count("\n") == 1
    assert (folder / RUN).is_file() and not (folder / SUMMARY).exists()
    how = error.split("the run: lanekeep bench ")[1]
    process = start(*shlex.split(how))
    _, error = process.communicate()
    assert process.returncode == 0, error
    assert_same_results(folder, unbroken)
