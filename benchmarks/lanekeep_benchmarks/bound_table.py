"""Bounds in a summary: a row of their own in each scenario's table, and what share of them every policy reaches."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lanekeep_benchmarks.bound import BOUND, FOLDER, TOLD, BoundPlan
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.report import tables
from lanekeep_benchmarks.results import EPISODES, LARGEST_LINES, SUMMARY, TABLE, read_lines
from lanekeep_benchmarks.run_record import RunRecord
from lanekeep_benchmarks.summary import RETURN, rows_of, summarise_rows
from lanekeep_env.files import locked, read_bounded, write_atomic
from lanekeep_env.plain import parse_json

Lines = dict[tuple[str, str], dict[int, EpisodeResult]]


def with_bounds(summary: dict[str, Any], results: Iterable[EpisodeResult], folder: Path) -> dict[str, Any]:
    """Return the summary of a run, with the bounds in its folder where there are some of the same episodes.

    Each scenario then has ``bounds``, rows over the episodes that both have driven (empty: no bound is known), and
    each of its policies ``share_of_bound``: the bound's mean cost over the policy's, NaN-free, at most 1 for what
    learns of road and car as it drives.
    """
    bounds = read_bounds(folder, summary)
    if not bounds:
        return summary
    driven = _sorted(results)
    return {**summary, "scenarios": [_scenario(entry, summary, driven, bounds) for entry in summary["scenarios"]]}


def read_bounds(folder: Path, summary: Mapping[str, Any]) -> Lines:
    """Return the lines of the bounds in a folder that are of the episodes of a summary, {} where there are none."""
    try:
        found = RunRecord.read(folder / FOLDER)
        if found is None or (found.suite, found.seed) != (summary["suite"], summary["seed"]):
            return {}
        hashes = {entry["scenario"]: entry["scenario_hash"] for entry in summary["scenarios"]}
        if any(hashes.get(name) != found.scenario_hash[name] for name in found.scenario_hash):
            return {}
        content = read_bounded(folder / FOLDER / EPISODES, LARGEST_LINES)
        return _sorted(line for _, line in read_lines(content) if not found.line_differences(line))
    except (OSError, ValueError) as error:
        warnings.warn(f"the bounds in {folder / FOLDER} are left out: {error}", stacklevel=2)
        return {}


def _sorted(lines: Iterable[EpisodeResult]) -> Lines:
    found: Lines = {}
    for line in lines:
        found.setdefault((line.scenario, line.policy), {})[line.episode] = line
    return found


def _scenario(entry: dict[str, Any], summary: Mapping[str, Any], driven: Lines, bounds: Lines) -> dict[str, Any]:
    name = entry["scenario"]
    labels = rows_of(list(dict.fromkeys(policy for scenario, policy in driven if scenario == name)))
    reference = entry["policies"][0]["policy"]
    common = sorted(bounds.get((name, BOUND), {}).keys() & range(summary["episodes"]))
    if not common or RETURN not in entry["policies"][0]["metrics"]:
        return {**entry, "bounds": []}
    theirs = _lines(driven, name, labels[reference], common)
    rows = []
    for policy in (BOUND, TOLD):
        if (name, policy) in bounds:
            beside = [theirs, _lines(bounds, name, [policy], common)]
            row = summarise_rows(beside, [reference, policy])[1]
            # Who has won an episode is between policies.
            rows.append({**row, "won": None, "episodes": len(common)})
    best = rows[0]["metrics"][RETURN]["value"]
    told = [
        {**row, "share_of_bound": _share(best, _lines(driven, name, labels[row["policy"]], common))}
        for row in entry["policies"]
    ]
    rows = [{**row, "share_of_bound": _ratio(best, row["metrics"][RETURN]["value"])} for row in rows]
    return {**entry, "policies": told, "bounds": rows}


def _lines(found: Lines, scenario: str, policies: Sequence[str], episodes: Sequence[int]) -> list[list[EpisodeResult]]:
    return [[found[scenario, policy][episode] for episode in episodes] for policy in policies]


def _share(best: float, lines: Sequence[Sequence[EpisodeResult]]) -> float | None:
    return _ratio(best, float(np.mean([line.metrics[RETURN] for seed in lines for line in seed])))


def _ratio(best: float, reached: float) -> float | None:
    """Costs are minus the returns; None where they are none."""
    return best / reached if best < 0.0 and reached < 0.0 else None


def bound_summary(plan: BoundPlan) -> dict[str, Any]:
    """Mean returns of a run of bounds by scenario, as plain data."""
    lines = _sorted(plan.results)

    def mean(name: str, policy: str) -> float | None:
        found = lines.get((name, policy))
        return None if not found else float(np.mean([line.metrics[RETURN] for line in found.values()]))

    scenarios: dict[str, Any] = {}
    for scenario in plan.suite.scenarios:
        name = scenario.name
        if name in plan.unknown:
            scenarios[name] = {"why": plan.unknown[name]}
        else:
            failed = [line.failed for line in lines[name, BOUND].values()]
            rate = float(np.mean(failed))
            scenarios[name] = {"bound": mean(name, BOUND), "told": mean(name, TOLD), "failure_rate": rate}
    return {"suite": plan.suite.name, "seed": plan.seed, "episodes": plan.episodes, "scenarios": scenarios}


def rewrite_tables(folder: Path) -> bool:
    """Put the bounds into the summary and the tables of the run in a folder; False where no run is complete there.

    Raises:
        ValueError: its files are damaged.
    """
    file = folder / SUMMARY
    if not file.exists():
        return False
    summary = parse_json(read_bounded(file, LARGEST_LINES))
    lines = [line for _, line in read_lines(read_bounded(folder / EPISODES, LARGEST_LINES))]
    with locked(folder):
        summary = with_bounds(summary, lines, folder)
        write_atomic(file, json.dumps(summary, indent=1, allow_nan=False) + "\n")
        write_atomic(folder / TABLE, tables(summary, lines))
    return True
