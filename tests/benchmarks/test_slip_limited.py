"""`slip-limited+NAME` wherever a policy is named: shipped, learned, one's own, driven again, verified."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lanekeep_baselines.slip_limit import SlipLimited
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.policies import check_policy, entry_of, make_policy
from lanekeep_env.scenario import LaneKeepScenario

SLIPPERY: dict[str, Any] = {"tyre": "magic_formula", "preview": 20, "departure": "cost"}
OWN = """
import lanekeep_baselines
def make(scenario):
    return lanekeep_baselines.make("stanley", scenario)
"""
SUITE = """
name = "slippery"
description = "one road"
episodes = 4
policies = ["stanley", "slip-limited+stanley"]
[common.keywords]
preview = 20
departure = "cost"
tyre = "magic_formula"
randomisation = { friction = 0.45 }
[[scenario]]
name = "short"
title = "Short"
max_episode_steps = 40
"""


@pytest.mark.parametrize("name", ["stanley", "distilled-lane-keep-seed0", "ppo-lane-keep-seed0"])
def test_any_policy_is_limited_by_its_name(name: str) -> None:
    scenario = LaneKeepScenario(**SLIPPERY)
    check_policy(f"slip-limited+{name}")
    made = make_policy(f"slip-limited+{name}", scenario)
    entry = entry_of(f"slip-limited+{name}")
    assert isinstance(made, SlipLimited) and made.name == entry.name == f"slip-limited+{name}"
    assert entry.sha256 == entry_of(name).sha256
    seen = np.zeros((3, len(scenario.channels)), dtype=np.float32)
    state = plain = None
    for _ in range(3):
        action, state = made.predict(seen, state)
        other, plain = make_policy(name, scenario).predict(seen, plain)
        np.testing.assert_array_equal(action, other)


def test_what_is_unknown_behind_the_prefix_is_named() -> None:
    with pytest.raises(ValueError, match=r"^policy 'stanly' is unknown.*'stanley'"):
        entry_of("slip-limited+stanly")
    with pytest.raises(ValueError, match="is code, which only a person may name"):
        check_policy("slip-limited+mine.py:make")


def test_runs_with_limited_policies_are_verified_and_driven_again(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(OWN)
    Path("slippery.toml").write_text(SUITE)
    names = "stanley,slip-limited+stanley,slip-limited+mine.py:make"
    assert main(["bench", "slippery.toml", "--policies", names, "--out", "run"]) == 0
    assert main(["verify", "run", "--policies", "slip-limited+mine.py:make"]) == 0
