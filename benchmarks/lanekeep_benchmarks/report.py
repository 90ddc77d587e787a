"""From result lines to a summary (JSON) and to tables (terminal, Markdown)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.evaluate import EpisodeResult
from lanekeep_benchmarks.statistics import (
    CONFIDENCE,
    RESAMPLES,
    Interval,
    bootstrap_means,
    seeds_mean,
    seeds_rate,
    wilson,
)
from lanekeep_benchmarks.suites import Suite


@dataclass(frozen=True)
class Column:
    """A metric as the tables show it; less of it is better unless ``more_is_better``."""

    key: str
    label: str
    unit: str
    digits: int
    more_is_better: bool = False


COLUMNS = (
    Column("lap_time", "lap time", "s", 2),
    Column("rms_lateral_error", "RMS lateral error", "m", 3),
    Column("peak_lateral_error", "peak lateral error", "m", 3),
    Column("rms_steering_rate", "RMS steering rate", "rad/s", 4),
    Column("peak_lateral_acceleration", "peak lateral acceleration", "m/s²", 2),
    Column("return", "return", "", 1, more_is_better=True),
)
#: How a cell shows that the interval of the paired difference to the reference excludes zero.
MARKS = {"better": " ▲", "worse": " ▼", "tie": ""}
#: What stands for the training seed in the name that seeds share.
_ANY_SEED = "-seed*"


def columns_of(rows: Sequence[Mapping[str, Any]]) -> tuple[Column, ...]:
    """The columns of a scenario's policies: those of which it has metrics. The first one is what differences are of."""
    return tuple(column for column in COLUMNS if column.key in rows[0]["metrics"])


def rows_of(policies: Sequence[str]) -> dict[str, list[str]]:
    """The rows of a table, label to policies: training seeds ``NAME-seed0``, ``NAME-seed1``, ... share one."""
    rows: dict[str, list[str]] = {}
    for policy in policies:
        rows.setdefault(re.sub(r"-seed\d+(?=(\.json)?$)", _ANY_SEED, policy), []).append(policy)
    return {
        f"{pattern.replace(_ANY_SEED, '')} ({len(row)} seeds)" if len(row) > 1 else row[0]: row
        for pattern, row in rows.items()
    }


def summarise(suite: Suite, results: Iterable[EpisodeResult], policies: Sequence[str]) -> dict[str, Any]:
    """Summary of a run: for each scenario and policy every metric with its interval, as plain JSON-able data.

    Differences are paired, policy minus reference on the same episodes; the reference is the first policy. Training
    seeds of one policy are one row, whose intervals are over seeds and episodes.

    Raises:
        ValueError: a policy has no results on a scenario, or not those of the reference's episodes.
    """
    table: dict[tuple[str, str], list[EpisodeResult]] = {}
    for result in results:
        table.setdefault((result.scenario, result.policy), []).append(result)
    rows = rows_of(policies)
    scenarios = []
    for scenario in suite.scenarios:
        for name in policies:
            if (scenario.name, name) not in table:
                raise ValueError(f"{scenario.name}: there are no results of {name}")
        by_policy = {name: sorted(table[scenario.name, name], key=lambda result: result.episode) for name in policies}
        first = by_policy[policies[0]]
        for name, lines in by_policy.items():
            if [line.episode_seed for line in lines] != [line.episode_seed for line in first]:
                raise ValueError(f"{scenario.name}: {name} and {policies[0]} have not driven the same episodes")
        scenarios.append(
            {
                "scenario": scenario.name,
                "title": scenario.title,
                "scenario_hash": first[0].scenario_hash,
                "env_id": scenario.env_id,
                "keywords": dict(scenario.keywords),
                "told": dict(scenario.told),
                "options": dict(scenario.options),
                "max_episode_steps": scenario.max_episode_steps,
                "policies": _summarise_rows([[by_policy[name] for name in row] for row in rows.values()], list(rows)),
            }
        )
    any_line = next(iter(table.values()))[0]
    return {
        "suite": suite.name,
        "description": suite.description,
        "version": any_line.version,
        "seed": any_line.seed,
        "episodes": len(first),
        "confidence": CONFIDENCE,
        "resamples": RESAMPLES,
        "reference": next(iter(rows)),
        "scenarios": scenarios,
    }


def _summarise_rows(rows: Sequence[Sequence[Sequence[EpisodeResult]]], labels: Sequence[str]) -> list[dict[str, Any]]:
    """Intervals of one scenario for rows of training seeds of result lines.

    One bootstrap serves all columns, which makes the differences paired; only where there are several training seeds,
    their own interval takes its place.
    """
    columns = [column for column in COLUMNS if column.key in rows[0][0][0].metrics]
    keys = [column.key for column in columns]
    samples = [np.array([[[line.metrics[key] for key in keys] for line in lines] for lines in row]) for row in rows]
    values = np.array([sample.mean(axis=0) for sample in samples])
    differences = values - values[:1]
    stacked = np.concatenate([values, differences], axis=2)  # (rows, episodes, 2 metrics)
    count, episodes, width = stacked.shape
    flat = stacked.transpose(1, 0, 2).reshape(episodes, count * width)
    intervals = bootstrap_means(flat, np.random.default_rng(0))
    summary = []
    for index, (label, row, sample) in enumerate(zip(labels, rows, samples, strict=True)):
        mine = intervals[index * width : (index + 1) * width]
        metrics, difference = mine[: len(keys)], mine[len(keys) :]
        failed = np.array([[line.failed for line in lines] for lines in row])
        rate = wilson(int(failed.sum()), episodes)
        if len(row) > 1:
            metrics = [seeds_mean(sample[:, :, place]) for place in range(len(keys))]
            rate = seeds_rate(failed)
        if len(row) > 1 or len(rows[0]) > 1:
            difference = [seeds_mean(sample[:, :, place], samples[0][:, :, place]) for place in range(len(keys))]
        verdicts = [
            _verdict(interval, column.more_is_better) for column, interval in zip(columns, difference, strict=True)
        ]
        summary.append(
            {
                "policy": label,
                "seeds": len(row),
                "failures": int(failed.sum()),
                "failure_rate": _plain(rate),
                "metrics": dict(zip(keys, map(_plain, metrics), strict=True)),
                "difference_to_reference": dict(zip(keys, map(_plain, difference), strict=True)) if index else None,
                "verdict": dict(zip(keys, verdicts, strict=True)) if index else None,
            }
        )
    return summary


def _verdict(difference: Interval, more_is_better: bool) -> str:
    """Whether a paired difference is "better" or "worse" than zero beyond its interval, or a "tie"."""
    if not (difference.low > 0.0 or difference.high < 0.0):  # NaN, too
        return "tie"
    return "better" if (difference.value > 0.0) == more_is_better else "worse"


def _plain(interval: Interval) -> dict[str, float | None]:
    """As JSON has it: null instead of NaN."""
    return {key: None if math.isnan(value) else value for key, value in asdict(interval).items()}


def headings(columns: Sequence[Column], reference: str) -> list[str]:
    """Column headings of a scenario's table."""
    names = [f"{column.label} [{column.unit}]" if column.unit else column.label for column in columns]
    return ["policy", "failure rate [%]", *names, f"{columns[0].label} − {reference}'s [{columns[0].unit}]"]


def cells(row: dict[str, Any], columns: Sequence[Column]) -> list[tuple[str, str]]:
    """One policy's cells as (value, interval) in the order of the headings, without the policy's name."""
    found = [_cell({key: 100 * bound for key, bound in row["failure_rate"].items()}, 1)]
    for column in columns:
        value, interval = _cell(row["metrics"][column.key], column.digits)
        found.append((value + MARKS[row["verdict"][column.key]] if row["verdict"] else value, interval))
    difference = row["difference_to_reference"]
    first = columns[0]
    found.append(_cell(difference[first.key], first.digits, sign="+") if difference else ("reference", ""))
    return found


def _cell(interval: dict[str, float | None], digits: int, sign: str = "") -> tuple[str, str]:
    form = f"{{:{sign}.{digits}f}}"
    if interval["low"] is None:
        return form.format(interval["value"]), ""
    return form.format(interval["value"]), f"{form.format(interval['low'])}…{form.format(interval['high'])}"


def caption(summary: dict[str, Any]) -> str:
    """What a reader must know about the numbers, in one line."""
    episodes = summary["episodes"]
    what = (
        f"{episodes} episode{'s' if episodes > 1 else ''} a policy, the same for all (seed {summary['seed']}),"
        f" lanekeep {summary['version']}"
    )
    interval = f"{100 * summary['confidence']:.0f} % interval"
    if episodes == 1:
        return f"{what}; below the rate Wilson's {interval}; for means, one episode allows none"
    rows = [row for scenario in summary["scenarios"] for row in scenario["policies"]]
    seeds = (
        ", Student's over training seeds and episodes where there are several"
        if any(row["seeds"] > 1 for row in rows)
        else ""
    )
    marks = "" if len(rows) == len(summary["scenarios"]) else f"; ▲ better, ▼ worse than {summary['reference']}"
    return f"{what}; below each mean its {interval}: bootstrap over episodes{seeds}, Wilson for the rate{marks}"


def terminal_table(scenario: dict[str, Any], reference: str) -> Table:
    """Table of one scenario for the terminal, the interval below each value."""
    # Text, because plain strings are markup, which eats the units' brackets.
    table = Table(title=Text(scenario["title"], style="bold"), title_justify="left", row_styles=("", "dim"))
    columns = columns_of(scenario["policies"])
    for index, heading in enumerate(headings(columns, reference)):
        table.add_column(Text(heading), justify="right" if index else "left", no_wrap=not index)
    for row in scenario["policies"]:
        table.add_row(row["policy"], *("\n".join(cell).rstrip() for cell in cells(row, columns)))
    return table


def markdown(summary: dict[str, Any]) -> str:
    """All tables of a run as Markdown."""
    lines = [f"# {summary['suite']}: {summary['description']}", "", caption(summary) + "."]
    for scenario in summary["scenarios"]:
        columns = columns_of(scenario["policies"])
        names = headings(columns, summary["reference"])
        lines += ["", f"## {scenario['title']}", "", f"| {' | '.join(names)} |", f"|---{'|---:' * (len(names) - 1)}|"]
        for row in scenario["policies"]:
            texts = [f"{value}<br>{interval}" if interval else value for value, interval in cells(row, columns)]
            lines.append(f"| {row['policy']} | {' | '.join(texts)} |")
    return "\n".join(lines) + "\n"
