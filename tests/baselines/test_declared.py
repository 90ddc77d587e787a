"""What policies declare is what their designs and their steps do, and what the README says."""

from __future__ import annotations

import json
import subprocess
import sys
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from registry_options import OPTIONS

import lanekeep_baselines
import lanekeep_env
from lanekeep_baselines.policy import Scenario, SteeringPolicy
from lanekeep_env.adapters.highway import HighwayScenario
from lanekeep_env.scenario import (
    CameraLaneScenario,
    CircuitScenario,
    DriveScenario,
    EvasiveScenario,
    LaneKeepScenario,
    LaneSupportScenario,
    ObstacleCircuitScenario,
    ParallelParkScenario,
    ReversePathScenario,
    TrafficScenario,
    WallFollowScenario,
)

ROOT = Path(__file__).parents[2]
IDS = sorted(lanekeep_env.ENVIRONMENTS)
#: Scenarios drawn for each id, besides its default.
DRAWS = 2
#: Values with which conditions come and go, more of them than one of each option.
FURTHER: dict[str, list[Any]] = {
    "preview": [0, 1, 5, 6, 10, 11],
    "preview_interval": [0.05, 0.2, 0.5, 1.0],
    "plan": [0, 1, 7, 14],
    "plan_spacing": [0.3, 0.5, 1.0],
    "cost_weight": [0.0],
    "observation": ["full"],
}


def drawn(env_id: str, number: int) -> Any:
    """A scenario of ``env_id`` with options of the registry's tests, one in three of them; 0 is the default."""
    options = OPTIONS[env_id]
    scenario = lanekeep_env.ENVIRONMENTS[env_id].scenario
    rng = np.random.default_rng([IDS.index(env_id), number])
    while number:
        chosen = {key: [*values, *FURTHER.get(key, [])] for key, values in options.items() if key != "dtype"}
        chosen = {key: values for key, values in chosen.items() if values and rng.random() < 1 / 3}
        try:
            return scenario(**{k: values[rng.integers(len(values))] for k, values in chosen.items()})
        except ValueError:
            continue  # options that exclude each other
    return scenario()


def makes(name: str, scenario: Any) -> bool:
    try:
        lanekeep_baselines.make(name, scenario)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("number", range(1 + DRAWS))
@pytest.mark.parametrize("env_id", IDS)
def test_names_are_those_that_can_be_designed(env_id: str, number: int) -> None:
    scenario = drawn(env_id, number)
    assert lanekeep_baselines.names(scenario) == tuple(n for n in lanekeep_baselines.names() if makes(n, scenario))


class Watched:
    """A scenario that remembers which of its fields were read."""

    def __init__(self, scenario: Any) -> None:
        self.__dict__.update(scenario=scenario, read=set())

    def __getattr__(self, field: str) -> Any:
        self.__dict__["read"].add(field)
        return getattr(self.__dict__["scenario"], field)


WALLS = WallFollowScenario(observation="full")
LATE = CameraLaneScenario(sensors={"edge_distance": {"period": 0.08}})
EVERY = (LaneKeepScenario(preview=11), LATE, WALLS, CircuitScenario(), EvasiveScenario(), ReversePathScenario())
COURSES = (ObstacleCircuitScenario(), ParallelParkScenario(observation="full"))
SCENARIOS = {
    n: scenario
    for scenario in (HighwayScenario(), *EVERY, *COURSES, DriveScenario(), TrafficScenario(), LaneSupportScenario())
    for n in lanekeep_baselines.names(scenario)
}
#: Fields that every policy may read.
BASE = {name for name, member in vars(Scenario).items() if isinstance(member, property)}
every_policy = pytest.mark.parametrize("name", lanekeep_baselines.names())


@every_policy
def test_a_design_reads_the_declared_fields_and_no_others(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SteeringPolicy, "lacking", classmethod(lambda policy, scenario: ""))
    scenario = Watched(SCENARIOS[name])
    policy: Any = lanekeep_baselines.make(name, scenario)
    for need in policy.needs:
        assert need.lacking(scenario) == ""
    assert scenario.read | BASE == set(policy.fields()) >= BASE


@every_policy
def test_a_step_reads_the_declared_channels_and_no_others(name: str) -> None:
    """What was not declared is not a number, and changes nothing."""
    scenario = SCENARIOS[name]
    policy: Any = lanekeep_baselines.make(name, scenario)
    declared = np.array(
        [any(fnmatchcase(c.name, one) for one in (*policy.reads, *policy.uses)) for c in scenario.channels]
    )
    assert not declared.all()
    low, high = scenario.channel_bounds().T
    random = np.random.default_rng(0)
    rows = low + random.random((5, 40, len(low))) * (high - low)
    rows[..., [c.name == "gear" for c in scenario.channels]] = 1.0
    blind = np.where(declared, rows, np.nan)
    state = blind_state = None
    for seen, shown in zip(rows, blind, strict=True):
        action, state = policy.predict(seen, state)
        blind_action, blind_state = policy.predict(shown, blind_state)
        np.testing.assert_array_equal(blind_action, action)
        assert np.isfinite(action).all()


@every_policy
def test_a_policy_is_not_for_scenarios_without_a_channel_that_it_reads(name: str) -> None:
    """And its error names the channel; the policy that nevertheless steps without it would be a surprise."""
    policy = type(lanekeep_baselines.make(name, SCENARIOS[name]))
    assert issubclass(policy, SteeringPolicy) and policy.reads
    for channel in policy.reads:

        class Without(Watched):
            channels = tuple(c for c in SCENARIOS[name].channels if c.name != channel)

        assert name not in lanekeep_baselines.names(Without(SCENARIOS[name]))
        with pytest.raises(ValueError, match=f"'{name}' needs the channel '{channel}'"):
            lanekeep_baselines.make(name, Without(SCENARIOS[name]))


@pytest.mark.parametrize("thing", [None, 3, "lane-keep", 10**6000], ids=["none", "number", "word", "long"])
def test_what_is_no_scenario_is_said_in_a_line(thing: Any) -> None:
    assert lanekeep_baselines.names(thing) == (() if thing is not None else lanekeep_baselines.names())
    with pytest.raises(ValueError, match=r"^scenario=.{1,80} is none; pass env.unwrapped.scenario$"):
        lanekeep_baselines.make("pd", thing)


CODE = """
import json, sys
from importlib import import_module
{block}
import lanekeep_baselines
from lanekeep_env import scenario
found = dict()
for record, settings in {scenarios!r}:
    module = import_module("lanekeep_env.adapters.highway") if record == "HighwayScenario" else scenario
    one = getattr(module, record)(**settings)
    found[record] = lanekeep_baselines.names(one)
    {then}
print(json.dumps([found, sorted({{"control", "scipy.linalg"}} & set(sys.modules))]))
"""
TOLD = [
    ("LaneKeepScenario", {"preview": 11}),
    ("LaneSupportScenario", {}),
    ("CameraLaneScenario", {}),
    ("WallFollowScenario", {"observation": "full"}),
    ("CircuitScenario", {}),
    ("ObstacleCircuitScenario", {}),
    ("ParallelParkScenario", {}),
    ("EvasiveScenario", {}),
    ("ReversePathScenario", {}),
    ("DriveScenario", {}),
    ("TrafficScenario", {}),
    ("HighwayScenario", {}),
]


def told(block: str = "", then: str = "") -> tuple[dict[str, list[str]], list[str]]:
    """What names(scenario) says in a process of its own, and which packages of designs that imports (numba: scipy)."""
    code = CODE.format(block=block, then=then, scenarios=TOLD)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    found, imported = json.loads(done.stdout)
    return found, imported


def test_names_are_told_without_importing_what_designs() -> None:
    found, imported = told()
    assert imported == []
    assert {name for names in found.values() for name in names} == set(lanekeep_baselines.names())


def test_without_packages_the_rest_can_be_designed() -> None:
    """A policy that imports a package which it does not declare would raise ModuleNotFoundError."""
    block = "sys.modules.update(control=None, scipy=None)"
    found, _ = told(block, "[lanekeep_baselines.make(name, one) for name in found[record]]")
    missing = set(lanekeep_baselines.names()) - {name for names in found.values() for name in names}
    assert missing == {name for name in lanekeep_baselines.names() if name.startswith(("yin", "lq", "lane", "mpc"))}


def table() -> str:
    """The README's table of what policies declare; those that declare the same share a row."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for name, scenario in SCENARIOS.items():
        policy: Any = type(lanekeep_baselines.make(name, scenario))
        fields = [f"`{field}`" for field in policy.fields() if field not in BASE]
        besides = ", ".join([*fields, *(need.what for need in policy.needs), *policy.packages])
        channels = [", ".join(f"`{channel}`" for channel in some) for some in (policy.reads, policy.uses)]
        rows.setdefault((*channels, besides, f"`{policy.__module__.rpartition('.')[2]}.py`"), []).append(f"`{name}`")
    lines = ["| name | reads | uses, where it is there | needs besides | file |", "|---|---|---|---|---|"]
    lines += ["| " + " | ".join([", ".join(names), *row]) + " |" for row, names in rows.items()]
    return "\n".join(lines)


def test_the_readme_shows_what_is_declared() -> None:
    assert table() in (ROOT / "baselines" / "README.md").read_text(), f"baselines/README.md shall show\n{table()}"
