"""From result lines to a summary: plain data, every metric with its interval and its paired difference."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

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
    """A metric as the tables show it."""

    key: str
    label: str
    unit: str
    digits: int


COLUMNS = (
    Column("lap_time", "lap time", "s", 2),
    Column("rms_lateral_error", "RMS lateral error", "m", 3),
    Column("peak_lateral_error", "peak lateral error", "m", 3),
    Column("rms_steering_rate", "RMS steering rate", "rad/s", 4),
    Column("peak_lateral_acceleration", "peak lateral acceleration", "m/s²", 2),
    Column("return", "return", "", 1),
)
#: The metrics of which less is worse.
MORE_IS_BETTER = ("return",)
#: Key of the failure rate beside those of the metrics in differences and verdicts.
RATE = "failure_rate"
#: Digits of a rate; the tables show it as a percentage.
RATE_DIGITS = 3
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
    keys = [column.key for column in COLUMNS if column.key in rows[0][0][0].metrics]
    samples = [np.array([[_numbers(line, keys) for line in lines] for lines in row]) for row in rows]
    compared = [*keys, RATE]
    values = np.array([sample.mean(axis=0) for sample in samples])
    differences = values - values[:1]
    stacked = np.concatenate([values, differences], axis=2)  # (rows, episodes, 2 metrics)
    count, episodes, width = stacked.shape
    flat = stacked.transpose(1, 0, 2).reshape(episodes, count * width)
    intervals = bootstrap_means(flat, np.random.default_rng(0))
    summary = []
    for index, (label, row, sample) in enumerate(zip(labels, rows, samples, strict=True)):
        mine = intervals[index * width : (index + 1) * width]
        metrics, difference = mine[: len(keys)], mine[len(compared) :]
        failed = sample[:, :, -1]
        failures = int(failed.sum())
        if len(row) > 1:
            metrics = [seeds_mean(sample[:, :, place]) for place in range(len(keys))]
        if len(row) > 1 or len(rows[0]) > 1:
            difference = [seeds_mean(sample[:, :, place], samples[0][:, :, place]) for place in range(len(compared))]
        verdict = {key: _verdict(key, interval) for key, interval in zip(compared, difference, strict=True)}
        summary.append(
            {
                "policy": label,
                "seeds": len(row),
                "failures": failures,
                "failure_rate": _plain(wilson(failures, episodes) if len(row) == 1 else seeds_rate(failed)),
                "metrics": dict(zip(keys, map(_plain, metrics), strict=True)),
                "difference_to_reference": dict(zip(compared, map(_plain, difference), strict=True)) if index else None,
                "verdict": verdict if index else None,
            }
        )
    return summary


def _numbers(line: EpisodeResult, keys: Sequence[str]) -> list[float]:
    """The metrics and, at the end, 1 where the episode failed."""
    return [*(line.metrics[key] for key in keys), float(line.failed)]


def _verdict(key: str, difference: Interval) -> str:
    """Whether a paired difference is "better" or "worse" than zero beyond its interval, or a "tie".

    What the tables show as 0.000 is a tie however narrow its interval is.
    """
    digits = next((column.digits for column in COLUMNS if column.key == key), RATE_DIGITS)
    seen = abs(difference.value) >= 0.5 * 10.0**-digits
    if not seen or not (difference.low > 0.0 or difference.high < 0.0):  # NaN, too
        return "tie"
    return "better" if (difference.value > 0.0) == (key in MORE_IS_BETTER) else "worse"


def _plain(interval: Interval) -> dict[str, float | None]:
    """As JSON has it: null instead of NaN."""
    return {key: None if math.isnan(value) else value for key, value in asdict(interval).items()}
