"""What a benchmark run does, read from its options; everything is built once before anything is driven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import lanekeep_env
from lanekeep_benchmarks.engines import Engine
from lanekeep_benchmarks.evaluate import Policy
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.made import make_definitions, policies_of
from lanekeep_benchmarks.own_code import OwnCodeError
from lanekeep_benchmarks.policies import Entry, default_policies, entry_of
from lanekeep_benchmarks.run_record import MOST_EPISODES, RunRecord, code_hash
from lanekeep_benchmarks.suites import ENDING, Suite, SuiteScenario, check_frozen, find_suite, road_suite
from lanekeep_env.checks import require, shown, shown_path
from lanekeep_env.scenario import RoadScenario


@dataclass
class Plan:
    """What a run does; ``drivers`` has the policies of each scenario, ``results`` fill while it drives."""

    suite: Suite
    entries: dict[str, Entry]
    episodes: int
    seed: int
    road: Path | None
    smoothing: float | None = None
    suite_file: str | None = None
    trace: bool = False
    engine: Engine = field(default_factory=Engine)
    drivers: dict[str, list[str]] = field(default_factory=dict)
    scenario_hash: dict[str, str] = field(default_factory=dict)
    policy_sha256: dict[str, str] = field(default_factory=dict)
    metrics: dict[str, list[str]] = field(default_factory=dict)
    results: list[EpisodeResult] = field(default_factory=list)
    _made: dict[tuple[str, str], Policy] = field(default_factory=dict)

    def policy(self, name: str, definition: RoadScenario) -> Policy:
        """Return the policy designed for that definition; policies are pure, so one serves the whole run."""
        key = name, definition.hash
        if key not in self._made:
            self._made[key] = self.entries[name].make(definition)
        return self._made[key]

    @property
    def policies(self) -> list[str]:
        """Names of the policies, the reference first."""
        return list(self.entries)

    @property
    def total(self) -> int:
        """Number of episodes to drive."""
        return sum(map(len, self.drivers.values())) * self.episodes

    @property
    def record(self) -> RunRecord:
        """What `run.json` keeps of it."""
        return RunRecord(
            version=lanekeep_env.__version__,
            code=code_hash(),
            suite=self.suite.name,
            road=None if self.road is None else str(self.road),
            policies=self.policies,
            episodes=self.episodes,
            seed=self.seed,
            scenario_hash=self.scenario_hash,
            policy_sha256=self.policy_sha256,
            metrics=self.metrics,
            suite_file=self.suite_file,
            trace=self.trace,
            smoothing=self.smoothing,
        )


def make_plan(
    suite: str | Suite | None,
    policies: Sequence[Any] | None,
    road: Path | None,
    episodes: int | None,
    seed: int,
    smoothing: float | None = None,
) -> Plan:
    """Read the options; build everything once, so that nothing is driven before all of it is known to work.

    ``policies``: what `entry_of` takes; None for the suite's own.

    Raises:
        ValueError, OSError: unknown suite or policy, a scenario that cannot be made, a policy that cannot drive one, or
            a road that cannot be driven.
    """
    require("--episodes", episodes, "", at_least=1, at_most=MOST_EPISODES, whole=True, optional=True)
    require("--seed", seed, "", at_least=0, whole=True)
    if suite is not None and road is not None:
        raise ValueError(f"suite {shown(suite)} and --road {road} exclude each other; give one of them")
    if smoothing is not None and road is None:
        raise ValueError(f"--smoothing {smoothing} has no effect without --road, whose points it smooths")
    if isinstance(suite, Suite):
        chosen = suite
    else:
        chosen = find_suite(suite or "classical") if road is None else road_suite(road, smoothing)
    file = suite if isinstance(suite, str) and suite.endswith(ENDING) else None
    where = f"suite {shown_path(file or chosen.name)}"
    made = make_definitions(chosen, where)
    definitions = {name: one.definition for name, one in made.items()}
    if policies is None:
        entries = [entry_of(name, code=False) for name in policies_of(chosen, definitions, where)]
    else:
        fitting = partial(default_policies, list(definitions.values()), learned=True)
        entries = [entry_of(given, fitting=fitting) for given in policies]
    names = [entry.name for entry in entries]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"policies {shown(', '.join(names))} are not allowed: one or more with different names")
    plan = Plan(
        chosen, dict(zip(names, entries, strict=True)), episodes or chosen.episodes, seed, road, smoothing, file
    )
    for scenario in chosen.scenarios:
        plan.scenario_hash[scenario.name] = scenario.hash(definitions[scenario.name].hash)
        plan.metrics[scenario.name] = list(made[scenario.name].metrics)
    check_frozen(chosen, plan.scenario_hash)
    plan.drivers |= _drivers(plan, definitions)
    # What nobody drives is no part of the run.
    plan.suite = replace(chosen, scenarios=tuple(one for one in chosen.scenarios if plan.drivers[one.name]))
    for of in (plan.drivers, plan.scenario_hash, plan.metrics):
        for name in definitions.keys() - {one.name for one in plan.suite.scenarios}:
            del of[name]
    if plan.total > MOST_EPISODES:
        raise ValueError(
            f"--episodes {plan.episodes} is not allowed: over {len(chosen.scenarios)} scenarios and {len(names)} "
            f"policies these are {plan.total} episodes, allowed are {MOST_EPISODES}"
        )
    plan.policy_sha256 |= {entry.name: entry.sha256 for entry in entries if entry.sha256 is not None}
    return plan


def _drivers(plan: Plan, definitions: Mapping[str, Any]) -> dict[str, list[str]]:
    """The policies of each scenario, all of which are made here.

    Raises:
        ValueError: one cannot drive a scenario; where each environment has its own, none at all.
    """
    drivers: dict[str, list[str]] = {scenario.name: [] for scenario in plan.suite.scenarios}
    for name in plan.policies:
        why: ValueError | None = None
        drives = False
        for part in plan.suite.parts.values():
            try:
                for scenario in part:
                    _check_drives(plan, name, scenario, definitions[scenario.name])
            except ValueError as error:
                if not plan.suite.per_environment or _fails(error):
                    raise
                why = why or error
                continue
            drives = True
            for scenario in part:
                drivers[scenario.name].append(name)
        if why is not None and not drives:
            raise why
    return drivers


def _check_drives(plan: Plan, name: str, scenario: SuiteScenario, definition: Any) -> None:
    try:
        plan.policy(name, scenario.policies_scenario(definition))
    except (ValueError, ImportError) as error:
        raise ValueError(f"{name} cannot drive {scenario.name} of {plan.suite.name}: {error}") from error


def _fails(error: ValueError) -> bool:
    """Whether a policy is broken or lacks a package, where others refuse a scenario."""
    cause = error.__cause__
    return isinstance(cause, ImportError) or (
        isinstance(cause, OwnCodeError) and not isinstance(cause.__cause__, ValueError)
    )
