"""The page for control engineers: a PD, an LQR and an MPC of a user's own in one table beside the shipped policies."""

from pathlib import Path

import pytest

import lanekeep_benchmarks
from lanekeep_benchmarks.__main__ import main

pytest.importorskip("casadi")
EXAMPLES = Path(__file__).parents[2] / "benchmarks" / "examples"
SUITE = """
name = "mine"
description = "random roads, 20 curvatures ahead"
episodes = 3

[[scenario]]
name = "roads"
title = "Random roads"
keywords = { preview = 20, departure = "cost" }
max_episode_steps = 200
"""


def test_own_controllers_stand_beside_shipped_ones(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("my_suite.toml").write_text(SUITE)
    assert main(["new", "controller", "my-pd"]) == 0
    own = ["my_pd.py:MyPd", f"{EXAMPLES / 'lqr.py'}:Lqr", f"{EXAMPLES / 'mpc.py'}:make"]
    shipped = ["lq-preview", "stanley", "pd"]
    assert main(["bench", "my_suite.toml", "--policies", ",".join([*shipped, *own]), "--out", "out"]) == 0
    results, _ = lanekeep_benchmarks.read("out")
    assert not results[results["policy"].isin(own)]["failed"].any()
    mean = results.groupby("policy")["return"].mean()
    # A feedforward beats none; the linear optimum of the benchmark's cost beats them all, the MPC comes next to it.
    assert mean["lq-preview"] == mean.max()
    assert mean[own[2]] == mean.drop("lq-preview").max() and mean[own[2]] > 3.0 * mean["lq-preview"]
    assert mean[own[0]] > mean["pd"]


@pytest.mark.parametrize("name", ["lqr.py", "mpc.py", "pd.py"])
def test_an_example_is_short(name):
    lines = (EXAMPLES / name).read_text().splitlines()
    assert len([line for line in lines if line.strip() and not line.strip().startswith(("#", '"""'))]) <= 42
