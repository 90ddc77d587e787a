"""`slip-limited+NAME` wherever a policy is named: shipped, learned, one's own, verified, resumed, played."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_benchmarks
from lanekeep_baselines.slip_limit import SlipLimited
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.engines import Engine
from lanekeep_benchmarks.policies import check_policy, entry_of
from lanekeep_env.scenario import LaneKeepScenario

SLIPPERY: dict[str, Any] = {"tyre": "magic_formula", "preview": 20, "departure": "cost"}
OWN = """
import lanekeep_baselines
def make(scenario):
    return lanekeep_baselines.make("stanley", scenario)

class Still:
    def act(self, observation):
        return 0.0

def alone(scenario):
    return lanekeep_baselines.OneByOne(Still)
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


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: Any, unpainted: None) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    Path("mine.py").write_text(OWN)
    Path("slippery.toml").write_text(SUITE)
    yield tmp_path
    sys.modules.pop("mine", None)


@pytest.mark.parametrize("name", ["stanley", "distilled-lane-keep-seed0", "ppo-lane-keep-seed0"])
def test_any_policy_is_limited_by_its_name(name: str) -> None:
    """At 30 m/s no tyre gives the lateral acceleration of a yaw rate of 0.6 rad/s; estimates follow within steps."""
    scenario = LaneKeepScenario(**SLIPPERY)
    check_policy(f"slip-limited+{name}")
    entry = entry_of(f"slip-limited+{name}")
    limited, plain = entry.make(scenario), entry_of(name).make(scenario)
    assert isinstance(limited, SlipLimited) and limited.name == entry.name == f"slip-limited+{name}"
    assert entry.sha256 == entry_of(name).sha256
    seen = np.zeros((3, len(scenario.channels)), dtype=np.float32)
    np.testing.assert_array_equal(limited.predict(seen)[0], plain.predict(seen)[0])
    order = [channel.name for channel in scenario.channels]
    seen[:, order.index("lateral_error")], seen[:, order.index("heading_error")] = -0.5, -0.3
    seen[:, order.index("speed")], seen[:, order.index("yaw_rate")] = 30.0, -0.6
    state = other = None
    for _ in range(3):
        action, state = limited.predict(seen, state)
        free, other = plain.predict(seen, other)
    assert (action != free).all()


def test_what_is_unknown_behind_the_prefix_is_named() -> None:
    with pytest.raises(ValueError, match=r"^policy 'stanly' is unknown.*'stanley'"):
        entry_of("slip-limited+stanly")
    with pytest.raises(ValueError, match="is code, which only a person may name"):
        check_policy("slip-limited+mine.py:make")


def test_one_filter_is_enough() -> None:
    for name in (entry_of, check_policy):
        with pytest.raises(
            ValueError, match=r"^policy 'slip-limited\+slip-limited\+stanley' is limited twice; .* once$"
        ):
            name("slip-limited+slip-limited+stanley")
    with pytest.raises(ValueError, match=r"^name='slip-limited\+mine' is not allowed"):
        lanekeep_baselines.register("slip-limited+mine", lanekeep_baselines.OneByOne)


def lines(run: str) -> list[str]:
    return sorted(Path(run, "episodes.jsonl").read_text().splitlines())


def test_runs_with_limited_policies_are_verified_resumed_and_played(folder: Path, capsys: Any) -> None:
    own = "slip-limited+mine.py:make"
    names = f"stanley,slip-limited+stanley,{own}"
    assert main(["bench", "slippery.toml", "--policies", names, "--out", "run"]) == 0
    assert main(["verify", "run", "--policies", own]) == 0
    whole = lines("run")
    Path("run", "episodes.jsonl").write_text("".join(line + "\n" for line in whole[:2]))
    assert main(["bench", "--resume", "--out", "run", "--policies", names]) == 0
    assert lines("run") == whole
    pytest.importorskip("pygame")
    capsys.readouterr()
    assert main(["play", "--run", "run", "--episode", "1", "--policy", own]) == 0
    assert f"{own} drove" in capsys.readouterr().out


def test_registered_controllers_are_limited_in_other_processes(folder: Path, monkeypatch: Any) -> None:
    """They do not know what is registered here."""
    monkeypatch.setattr(lanekeep_baselines, "_REGISTERED", {})
    lanekeep_baselines.register("own", importlib.import_module("mine").make)
    for out, engine in (("here", Engine()), ("there", Engine("processes", 1))):
        lanekeep_benchmarks.benchmark("slippery.toml", ["slip-limited+own"], out=out, engine=engine)
    assert lines("here") == lines("there")


@pytest.mark.parametrize("wrap", [lambda make, scenario: SlipLimited(make(scenario), scenario), partial])
def test_what_a_handed_over_policy_wraps_is_part_of_it(folder: Path, wrap: Any) -> None:
    scenario = LaneKeepScenario(**SLIPPERY)
    mine = importlib.import_module("mine")
    given = [wrap(mine.alone, scenario), lanekeep_baselines.OneByOne(mine.Still)]
    before = [entry_of(one).sha256 for one in given]
    assert before == [entry_of(one).sha256 for one in given]
    Path("mine.py").write_text(OWN + "# another one\n")
    assert not set(before) & {entry_of(one).sha256 for one in given}


def test_what_was_handed_over_is_not_taken_for_what_is_shipped(folder: Path, capsys: Any) -> None:
    """Their names are the same; the run has another policy beside it, which is verified."""

    def mine(scenario: Any) -> Any:
        return SlipLimited(lanekeep_baselines.make("stanley", scenario), scenario)

    mine.name = "slip-limited+stanley"  # type: ignore[attr-defined]
    lanekeep_benchmarks.benchmark("slippery.toml", [mine, "stanley"], out="run")
    assert main(["verify", "run"]) == 0
    assert "handed over in Python" in "".join(capsys.readouterr())
    assert main(["play", "--run", "run", "--episode", "1", "--policy", "slip-limited+stanley"]) == 2
    assert "was handed over in Python" in capsys.readouterr().err
