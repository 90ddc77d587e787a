"""Engines: the same lines whatever drives, and none lost or doubled whatever dies."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

import lanekeep_baselines
import lanekeep_benchmarks
from lanekeep_benchmarks import engines, runs
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.reporting import write_report
from lanekeep_benchmarks.results import EPISODES

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals")

SUITE = """
name = "short"
description = "two short scenarios"
episodes = 4
[common]
max_episode_steps = 30
[[scenario]]
name = "slalom"
title = "A slalom"
keywords = { road = "slalom", departure = "cost", preview = 1 }
[[scenario]]
name = "circle"
title = "A circle"
keywords = { road = "circle", departure = "cost", preview = 1 }
"""
CODE = """
import os, signal, time
from lanekeep_baselines import SteeringPolicy

class Mine(SteeringPolicy):
    name, reads = "mine", ("lateral_error", "heading_error")

    def command(self, at, memory, fresh):
        return -0.03 * at["lateral_error"] - 0.6 * at["heading_error"], None

class Deadly(Mine):
    name = "deadly"
    def command(self, at, memory, fresh):
        if not os.path.exists("died"):
            open("died", "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().command(at, memory, fresh)

class AlwaysDeadly(Mine):
    name = "always"
    def command(self, at, memory, fresh):
        os.kill(os.getpid(), signal.SIGKILL)

class Slow(Mine):
    name = "slow"
    def command(self, at, memory, fresh):
        time.sleep(0.01)
        return super().command(at, memory, fresh)

class Broken(Mine):
    name = "broken"
    def command(self, at, memory, fresh):
        raise ZeroDivisionError("mine")
"""
PROCESSES = ["--engine", "processes", "--workers", "2"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "suite.toml").write_text(SUITE)
    (tmp_path / "mine.py").write_text(CODE)
    return tmp_path


def bench(out, policies, *options):
    return main(["bench", "suite.toml", "--policies", policies, "--out", str(out), *options])


def lines(folder):
    """Result lines by what tells them apart, without the policy's name; each of them once."""
    found = [json.loads(text) for text in (folder / EPISODES).read_text().splitlines()]
    places = Counter((line["scenario"], line["policy"], line["episode"]) for line in found)
    assert set(places.values()) == {1}
    return sorted(json.dumps(line | {"policy": ""}) for line in found)


def test_serial_and_two_processes_write_the_same_lines(here, monkeypatch):
    """64 rows or one, in this process or in two."""
    policies = "stanley,mine.py:Mine"
    for name, rows, options in (("serial", 64, []), ("one", 1, []), ("two", 1, ["--trace", *PROCESSES])):
        monkeypatch.setattr("lanekeep_benchmarks.evaluate.CARS", rows)
        assert bench(here / name, policies, *options) == 0
        assert lines(here / "serial") == lines(here / name)
    for name in ("summary.json", "summary.md", "plot_errors.png"):
        assert (here / "serial" / name).read_bytes() == (here / "two" / name).read_bytes()
    _, steps = lanekeep_benchmarks.read(here / "two")
    assert len(steps) == 2 * 2 * 4 * 30


def test_a_worker_that_dies_costs_nothing(here):
    assert bench(here / "whole", "mine.py:Mine") == 0
    assert bench(here / "out", "mine.py:Deadly", *PROCESSES) == 0
    assert (here / "died").is_file() and lines(here / "out") == lines(here / "whole")


def test_a_policy_that_kills_every_worker_ends_the_run_in_one_line(here, capsys, monkeypatch):
    monkeypatch.setattr(engines, "TRIES", 2)
    assert bench(here / "out", "stanley,mine.py:AlwaysDeadly", *PROCESSES) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "a worker died 2 times while mine.py:AlwaysDeadly drove" in error
    assert "lanekeep bench --resume" in error


def test_what_fails_in_a_worker_is_the_same_line(here, capsys):
    errors = []
    for options in ([], PROCESSES):
        assert bench(here / f"out{len(errors)}", "mine.py:Broken", *options) == 1
        errors.append(re.sub("out.", "out", capsys.readouterr().err))
    assert errors[0] == errors[1] and errors[0].count("\n") == 1 and "ZeroDivisionError: mine" in errors[0]


def test_what_cannot_travel_is_refused_before_anything_is_driven(here):
    with pytest.raises(ValueError, match=r"cannot go to another process .*; name it as module:factory"):
        lanekeep_benchmarks.benchmark(
            "suite.toml",
            [lambda scenario: lanekeep_baselines.make("pd", scenario)],
            engine="processes",
            out=here / "out",
        )
    assert not (here / "out").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--engine", "proceses"], "did you mean 'processes'?"),
        (["--workers", "2"], "--workers 2 has no effect with --engine serial"),
        (["--engine", "processes", "--workers", "0"], "--workers=0"),
        (["--engine", "processes", "--address", "auto"], "it is for --engine ray"),
    ],
)
def test_engines_are_checked(here, capsys, options, words):
    assert bench(here / "out", "stanley", *options) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1 and not (here / "out").exists()


def children(pid):
    found = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True).stdout.split()
    return [int(child) for child in found]


def start_slow(options):
    command = [sys.executable, "-m", "lanekeep_benchmarks", "bench", "suite.toml", "--policies", "mine.py:Slow"]
    pipe = subprocess.PIPE
    return subprocess.Popen([*command, "--episodes", "600", "--out", "out", *options], stdout=pipe, stderr=pipe)


def count(folder):
    file = folder / EPISODES
    return file.read_bytes().count(b"\n") if file.exists() else 0


def wait_for_lines(folder, process):
    """Until the first batch is on disk."""
    while count(folder) < 256 and process.poll() is None:
        time.sleep(0.01)


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_a_run_killed_with_its_workers_is_completed(here):
    """kill -9 of a worker, then of the run: its workers go with it, and --resume completes it, each line once."""
    process = start_slow(PROCESSES)
    wait_for_lines(here / "out", process)
    workers = [child for child in children(process.pid) if "spawn_main" in Path(f"/proc/{child}/cmdline").read_text()]
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGKILL)
    time.sleep(0.1)
    workers = set(children(process.pid)) | set(workers)
    process.kill()
    process.communicate()
    assert 256 <= count(here / "out") < 1200
    deadline = time.monotonic() + 20.0
    while any(os.path.exists(f"/proc/{worker}") for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(os.path.exists(f"/proc/{worker}") for worker in workers)
    assert main(["bench", "--resume", "--out", "out", "--policies", "mine.py:Slow", *PROCESSES]) == 0
    assert len(lines(here / "out")) == 1200


@pytest.mark.slow
def test_a_ray_cluster_loses_a_node_and_no_line(here, monkeypatch):
    """Two nodes, one of which is killed in the middle."""
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    monkeypatch.setattr("lanekeep_benchmarks.evaluate.CARS", 2)
    assert bench(here / "whole", "stanley,mine.py:Slow", "--episodes", "24") == 0
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        node = cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        engine = engines.Engine("ray", address=cluster.address)
        policies = ("stanley", "mine.py:Slow")
        options = runs.Options("suite.toml", policies, episodes=24, out=here / "out", engine=engine)
        plan, folder = runs.open_run(options)
        with folder:
            for place, _ in enumerate(runs.drive(plan, folder)):
                if place == 10:
                    cluster.remove_node(node, allow_graceful=False)
            write_report(plan, folder)
    finally:
        cluster.shutdown()
    assert lines(here / "out") == lines(here / "whole")
    assert (here / "out" / "summary.json").read_bytes() == (here / "whole" / "summary.json").read_bytes()


@pytest.mark.slow
def test_a_run_killed_on_a_ray_cluster_is_completed(here):
    """kill -9 of the run, whose tasks go with it while the cluster lives; --resume completes it there."""
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        options = ["--engine", "ray", "--address", cluster.address]
        process = start_slow(options)
        wait_for_lines(here / "out", process)
        process.kill()
        process.communicate()
        before = count(here / "out")
        assert 256 <= before < 1200
        time.sleep(2.0)
        assert count(here / "out") == before  # nobody else writes
        assert main(["bench", "--resume", "--out", "out", "--policies", "mine.py:Slow", *options]) == 0
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert bench(here / "whole", "mine.py:Slow", "--episodes", "600") == 0
    assert len(lines(here / "out")) == 1200 and lines(here / "out") == lines(here / "whole")
