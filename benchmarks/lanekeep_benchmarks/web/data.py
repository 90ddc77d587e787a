"""What the page of a run is made of, as plain JSON-able data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lanekeep_benchmarks.evaluate import episode_seed, make_cars
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.metrics import METRICS
from lanekeep_benchmarks.plan import Plan
from lanekeep_benchmarks.report import caption
from lanekeep_benchmarks.suites import SuiteScenario
from lanekeep_benchmarks.summary import rows_of
from lanekeep_benchmarks.web import page
from lanekeep_benchmarks.web.drives import chosen, ground, recorded
from lanekeep_env import layout as at

#: Numbers of all courses together, one to three bytes each in the page.
MOST_NUMBERS = 5_000_000
#: Characters of the page, above which courses and roads have fewer points, down to this share of them.
LARGEST_PAGE, LEAST_DETAIL = 14_000_000, 0.1
MOST_POINTS, FEWEST_POINTS = 600, 40
#: Of a signal between its least and its largest value: finer than a screen's pixels.
LEVELS = 2000
#: Points of a road's edge.
ROAD_POINTS = 600
#: What is shown over time, where an episode has it, the first four unasked: label and unit.
SIGNALS = {
    "lateral_error": ("lateral error", "m"),
    "steering_angle": ("steering angle, road wheel", "rad"),
    "speed": ("speed", "m/s"),
    "gap": ("gap to the car ahead", "m"),
    "distance": ("distance of the right wall", "m"),
    "stop_gap": ("way to the stop point", "m"),
    "assistance": ("angle that the assistant adds", "rad"),
    "authority": ("share of the assistant", ""),
    "clearance": ("clearance", "m"),
    "heading_error": ("heading error", "rad"),
    "speed_error": ("speed error", "m/s"),
    "lateral_acceleration": ("lateral acceleration", "m/s²"),
    "jerk": ("jerk", "m/s³"),
}
_PLACES = ("x", "y", "lead_x", "lead_y")

Drives = Mapping[str, Mapping[int, Mapping[str, Any]]]


def page_of(plan: Plan, summary: Mapping[str, Any], drives: Mapping[str, Drives]) -> str:
    """The page of a run, with as much detail as `LARGEST_PAGE` allows; arguments as `page_data` has them."""
    title, detail = f"{summary['suite']}: {summary['description']}", 1.0
    while True:
        text = page(title, page_data(plan, summary, drives, detail))
        if len(text) <= LARGEST_PAGE or detail == LEAST_DETAIL:
            return text
        detail = max(LEAST_DETAIL, 0.8 * detail * LARGEST_PAGE / len(text))


def page_data(
    plan: Plan, summary: Mapping[str, Any], drives: Mapping[str, Drives], detail: float = 1.0
) -> dict[str, Any]:
    """Everything that the page shows: the summary, the result lines, and what happened in ``drives``.

    Args:
        plan: of a run that has been driven.
        summary: of it.
        drives: scenario, policy and episode to what `drives.recorded` returns.
        detail: share of the points of courses and roads.
    """
    tables: dict[str, dict[str, list[EpisodeResult]]] = {scenario.name: {} for scenario in plan.suite.scenarios}
    for line in plan.results:
        tables[line.scenario].setdefault(line.policy, []).append(line)
    count = sum(len(of) for scenario in drives.values() for of in scenario.values())
    points = int(detail * np.clip(MOST_NUMBERS / (10 * max(count, 1)), FEWEST_POINTS, MOST_POINTS))
    return {
        "summary": summary,
        "caption": caption(dict(summary)),
        "rows": rows_of(plan.policies),
        "metrics": {
            key: {"label": one.label, "unit": one.unit, "digits": one.digits, "more": one.more_is_better}
            for key, one in METRICS.items()
        },
        "signals": SIGNALS,
        "lines": {
            name: {policy: _columns(lines, plan.metrics[name]) for policy, lines in of.items()}
            for name, of in tables.items()
        },
        "drives": {
            scenario.name: _drives(scenario, drives[scenario.name], points, int(detail * ROAD_POINTS))
            for scenario in plan.suite.scenarios
        },
    }


def _columns(lines: Sequence[EpisodeResult], metrics: Sequence[str]) -> dict[str, Any]:
    """Result lines of a policy, a column each; their numbers are those of `episodes.jsonl`."""
    lines = sorted(lines, key=lambda line: line.episode)
    columns: dict[str, Any] = {
        key: [getattr(line, key) for line in lines] for key in ("episode", "episode_seed", "steps")
    }
    columns["failed"] = [int(line.failed) for line in lines]
    return columns | {"metrics": {key: [line.metrics[key] for line in lines] for key in metrics}}


def drive_chosen(plan: Plan, scenario: SuiteScenario) -> dict[str, dict[int, dict[str, Any]]]:
    """Drive the episodes of a scenario that are shown once more; of every policy the first one too."""
    lines: dict[str, list[EpisodeResult]] = {name: [] for name in plan.drivers[scenario.name]}
    for line in plan.results:
        if line.scenario == scenario.name:
            lines[line.policy].append(line)
    env = make_cars(scenario, 1)
    told = scenario.policies_scenario(env.unwrapped.scenario)
    env.close()
    found = {}
    for name, episodes in chosen(lines, METRICS[plan.metrics[scenario.name][0]].more_is_better).items():
        numbers = sorted({0, *episodes})
        seeds = [episode_seed(plan.suite.name, scenario.name, number, plan.seed) for number in numbers]
        found[name] = dict(zip(numbers, recorded(scenario, plan.policy(name, told), seeds), strict=True))
    return found


def _drives(scenario: SuiteScenario, drives: Drives, points: int, road_points: int) -> dict[str, Any]:
    env = make_cars(scenario, 1)
    grounds = sorted({one["ground"] for of in drives.values() for one in of.values() if "x" in one})
    small = 1e-3 if hasattr(env.unwrapped, "world_set") else 1e-2
    found = {
        "control_step": env.unwrapped.scenario.control_step,
        "grounds": {
            number: [[_packed(axis, small) for axis in line.T] for line in ground(env.unwrapped, number, road_points)]
            for number in grounds
        },
        "of": {
            policy: {episode: _course(one, points, small) for episode, one in of.items()}
            for policy, of in drives.items()
        },
    }
    env.close()
    return found


def _course(one: Mapping[str, Any], points: int, small: float) -> dict[str, Any]:
    """What happened in an episode, at every so many steps and at the last."""
    steps = len(one["lateral_error"])
    stride = -(-steps // points)
    kept = np.append(np.arange(0, steps - 1, stride), steps - 1)
    course: dict[str, Any] = {"steps": steps, "stride": stride, "ground": one["ground"], "signals": {}}
    course |= {key: _packed(one[key][kept], small) for key in _PLACES if key in one}
    for key in SIGNALS:
        if key in one:
            values = np.where(np.abs(one[key][kept]) < at.NOWHERE, one[key][kept], np.nan)
            if np.isfinite(values).sum() > 1:
                course["signals"][key] = _packed(values, max(np.nanmax(values) - np.nanmin(values), 1e-6) / LEVELS)
    return course


def _packed(values: ArrayLike, step: float) -> list[Any]:
    """Numbers as whole multiples of ``step``: it, then the first multiple and each one's difference to that before."""
    multiples = np.asarray(values, dtype=np.float64) / step
    there = np.isfinite(multiples)
    whole = np.round(multiples[there]).astype(np.int64)
    differences = iter(np.diff(whole, prepend=0).tolist())
    return [float(step), *(next(differences) if known else None for known in there.tolist())]
