"""Summary, tables, page and pictures of a run, into its folder."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_benchmarks import plots
from lanekeep_benchmarks.bound_table import with_bounds
from lanekeep_benchmarks.evaluate import make_cars
from lanekeep_benchmarks.looks import interesting
from lanekeep_benchmarks.metrics import METRICS
from lanekeep_benchmarks.plan import Plan
from lanekeep_benchmarks.report import tables
from lanekeep_benchmarks.results import PAGE, SUMMARY, TABLE, ResultFolder
from lanekeep_benchmarks.suites import SuiteScenario
from lanekeep_benchmarks.summary import parts_of, rows_of, summarise
from lanekeep_benchmarks.web.data import Drives, drive_chosen, page_of


def write_report(plan: Plan, folder: ResultFolder) -> dict[str, Any]:
    """Write summary, tables, plots and the page that has all of it; return the summary."""
    summary = with_bounds(summarise(plan.suite, plan.results, plan.policies), plan.results, folder.path)
    folder.write(SUMMARY, json.dumps(summary, indent=1, allow_nan=False) + "\n")
    folder.write(TABLE, tables(summary, plan.results))
    drives = {scenario.name: drive_chosen(plan, scenario) for scenario in plan.suite.scenarios}
    values = _first_metrics(plan)
    for name, part in parts_of(summary).items():
        of_part = f"_{name}" if name else ""
        folder.write(f"plot_errors{of_part}.png", plots.plot_errors(part))
        folder.write(f"plot_profiles{of_part}.png", plots.plot_profiles(part, values))
        shown = interesting(part)
        for scenario in plan.suite.parts[name]:
            # One training seed shows what the others do; more would hide the other policies.
            drawn = {label: row[0] for label, row in rows_of(plan.drivers[scenario.name]).items()}
            traces = {policy: drives[scenario.name][policy] for policy in drawn.values()}
            _draw_episode(plan, folder, scenario, traces, [drawn[label] for label in shown])
    folder.write(PAGE, page_of(plan, summary, drives))
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


def _draw_episode(plan: Plan, folder: ResultFolder, scenario: SuiteScenario, drives: Drives, shown: list[str]) -> None:
    """Draw episode 0 of the policies in ``drives``, those ``shown`` in colours."""
    env = make_cars(scenario, 1)
    definition = env.unwrapped.scenario
    env.close()
    traces = {name: of[0] for name, of in drives.items()}
    title = f"{scenario.title}: episode 0, seed {plan.seed}"
    width = getattr(definition, "lane_width", None)
    picture = plots.plot_episode(title, traces, definition.control_step, width, shown)
    folder.write(f"plot_episode_{scenario.name}.png", picture)
    if plan.road is not None:
        picture = plots.plot_map(title, definition.road.build()[0], traces, definition.lane_width, shown)
        folder.write(f"plot_map_{scenario.name}.png", picture)
