"""One benchmark run from its options to its files: plan, drive, report."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lanekeep_env
from lanekeep_benchmarks import plots
from lanekeep_benchmarks.engines import Engine, Work, check_travels, drive_all
from lanekeep_benchmarks.evaluate import Policy, batches, episode_seed, make_cars, record
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.made import make_definitions, policies_of
from lanekeep_benchmarks.metrics import METRICS
from lanekeep_benchmarks.own_code import is_code
from lanekeep_benchmarks.policies import FILE, Entry, entry_of
from lanekeep_benchmarks.report import markdown
from lanekeep_benchmarks.results import SUMMARY, TABLE, ResultFolder, default_folder, written
from lanekeep_benchmarks.run_record import MOST_EPISODES, RunRecord, code_hash
from lanekeep_benchmarks.suites import ENDING, Suite, SuiteScenario, find_suite, road_suite
from lanekeep_benchmarks.summary import rows_of, summarise
from lanekeep_env.checks import require, shown, shown_path
from lanekeep_env.scenario import RoadScenario


@dataclass
class Plan:
    """What a run does; ``results`` fill while it drives."""

    suite: Suite
    entries: dict[str, Entry]
    episodes: int
    seed: int
    road: Path | None
    smoothing: float | None = None
    suite_file: str | None = None
    trace: bool = False
    engine: Engine = field(default_factory=Engine)
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
        return len(self.suite.scenarios) * len(self.policies) * self.episodes

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


def open_run(
    suite: str | Suite | None,
    policies: Sequence[Any] | None,
    road: Path | None,
    episodes: int | None,
    seed: int | None,
    *,
    out: Path | None,
    overwrite: bool = False,
    resume: bool = False,
    trace: bool = False,
    engine: Engine | None = None,
    smoothing: float | None = None,
) -> tuple[Plan, ResultFolder]:
    """Read the options and open the folder; what a resumed run has driven already is in the plan's results.

    Raises:
        ValueError, OSError: options that are not allowed, or a folder that holds results which must stay.
    """
    if resume and out is None:
        raise ValueError("--resume needs --out, the folder of the run to complete")
    if resume and overwrite:
        raise ValueError("--resume and --overwrite exclude each other; the one keeps results, the other removes them")
    if resume and out is not None and (found := RunRecord.read(out)) is not None:
        if suite is None and road is None:
            suite, road = (found.suite_file or found.suite, None) if found.road is None else (None, Path(found.road))
            smoothing = found.smoothing if smoothing is None else smoothing
        policies = _named_in(found) if policies is None else policies
        episodes = found.episodes if episodes is None else episodes
        seed = found.seed if seed is None else seed
        trace = trace or found.trace
    elif resume and suite is None and road is None and policies is None:
        raise ValueError(
            f"--out {out} holds no run to resume; name its folder, or a SUITE or --road to start one there"
        )
    plan = make_plan(suite, policies, road, episodes, 0 if seed is None else seed, smoothing)
    plan.trace, plan.engine = trace, engine or Engine()
    check_travels(plan.engine, {name: entry.given for name, entry in plan.entries.items()})
    folder = ResultFolder(out or default_folder(plan.suite.name), plan.record, overwrite, resume)
    plan.results += folder.earlier
    return plan, folder


def _named_in(record: RunRecord) -> tuple[str, ...]:
    """The policies of a run to complete; what it calls code is not run because a file says so."""
    code = [name for name in record.policies if is_code(name) and not name.endswith(FILE)]
    if code:
        raise ValueError(
            f"{', '.join(code)} of that run is code of your own, which is run only where you name it: "
            f"--policies {','.join(record.policies)}"
        )
    return tuple(record.policies)


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
        entries = [entry_of(name, code=False) for name in policies_of(chosen, definitions.values(), where)]
    else:
        entries = [entry_of(given) for given in policies]
    names = [entry.name for entry in entries]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"policies {shown(', '.join(names))} are not allowed: one or more with different names")
    plan = Plan(
        chosen, dict(zip(names, entries, strict=True)), episodes or chosen.episodes, seed, road, smoothing, file
    )
    if plan.total > MOST_EPISODES:
        raise ValueError(
            f"--episodes {plan.episodes} is not allowed: over {len(chosen.scenarios)} scenarios and {len(names)} "
            f"policies these are {plan.total} episodes, allowed are {MOST_EPISODES}"
        )
    for scenario in chosen.scenarios:
        definition = definitions[scenario.name]
        plan.scenario_hash[scenario.name] = scenario.hash(definition.hash)
        plan.metrics[scenario.name] = list(made[scenario.name].metrics)
        for name in names:
            try:
                plan.policy(name, scenario.policies_scenario(definition))
            except (ValueError, ImportError) as error:
                raise ValueError(f"{name} cannot drive {scenario.name} of {chosen.name}: {error}") from error
    plan.policy_sha256 |= {entry.name: entry.sha256 for entry in entries if entry.sha256 is not None}
    return plan


def drive(plan: Plan, folder: ResultFolder) -> Iterator[tuple[str, int]]:
    """Drive what has no result yet; yield (what was driven, how many) when it is on disk."""
    done = {result.place for result in plan.results}
    work = Work(
        plan.suite.name,
        plan.seed,
        "all" if plan.trace else "failed",
        {name: entry.given for name, entry in plan.entries.items()},
        plan.policy_sha256,
    )
    missing = batches(plan.suite, plan.policies, plan.episodes, done)
    for lines in written(folder, drive_all(plan.engine, work, missing, plan.policy)):
        plan.results += lines
        yield f"{lines[0].scenario}: {lines[0].policy}", len(lines)


def write_report(plan: Plan, folder: ResultFolder) -> dict[str, Any]:
    """Write summary, tables and plots; return the summary."""
    summary = summarise(plan.suite, plan.results, plan.policies)
    folder.write(SUMMARY, json.dumps(summary, indent=1, allow_nan=False) + "\n")
    folder.write(TABLE, markdown(summary))
    folder.write("plot_errors.png", plots.plot_errors(summary))
    folder.write("plot_profiles.png", plots.plot_profiles(summary, _first_metrics(plan)))
    # One training seed shows what the others do; more would hide the other policies.
    drawn = {label: row[0] for label, row in rows_of(plan.policies).items()}
    shown = [drawn[label] for label in plots.interesting(summary)]
    for scenario in plan.suite.scenarios:
        _draw_episode(plan, folder, scenario, drawn, shown)
    return summary


def _first_metrics(plan: Plan) -> dict[str, dict[str, NDArray[np.float64]]]:
    """The first metric of every episode by scenario and row, the worst there is where it failed."""
    found: dict[str, dict[str, list[float]]] = {}
    labels = {policy: label for label, row in rows_of(plan.policies).items() for policy in row}
    for line in plan.results:
        key = plan.metrics[line.scenario][0]
        worst = -math.inf if METRICS[key].more_is_better else math.inf
        of_row = found.setdefault(line.scenario, {}).setdefault(labels[line.policy], [])
        of_row.append(worst if line.failed else line.metrics[key])
    return {scenario: {label: np.array(of) for label, of in rows.items()} for scenario, rows in found.items()}


def _draw_episode(
    plan: Plan, folder: ResultFolder, scenario: SuiteScenario, drawn: dict[str, str], shown: list[str]
) -> None:
    """Drive episode 0 once more with the policies ``drawn``, those ``shown`` in colours."""
    seed = episode_seed(plan.suite.name, scenario.name, 0, plan.seed)
    env = make_cars(scenario, 1)
    definition = env.unwrapped.scenario
    env.close()
    told = scenario.policies_scenario(definition)
    traces = {name: record(scenario, plan.policy(name, told), seed) for name in drawn.values()}
    title = f"{scenario.title}: episode 0, seed {plan.seed}"
    width = getattr(definition, "lane_width", None)
    picture = plots.plot_episode(title, traces, definition.control_step, width, shown)
    folder.write(f"plot_episode_{scenario.name}.png", picture)
    if plan.road is not None:
        picture = plots.plot_map(title, definition.road.build()[0], traces, definition.lane_width, shown)
        folder.write(f"plot_map_{scenario.name}.png", picture)
