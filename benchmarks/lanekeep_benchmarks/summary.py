"""From result lines to a summary: plain data, every metric with its interval and its paired difference."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.metrics import METRICS, Metric
from lanekeep_benchmarks.seeds import probability_of_improvement, seeds_mean, seeds_rate
from lanekeep_benchmarks.statistics import (
    CONFIDENCE,
    MARKS_FROM,
    RESAMPLES,
    Interval,
    interquartile_means,
    means,
    paired_rates,
    student_means,
    wilson,
)
from lanekeep_benchmarks.suites import Suite, SuiteScenario

#: Key of the failure rate beside those of the metrics in differences and verdicts.
RATE = "failure_rate"
#: Digits of a rate; the tables show it as a percentage.
RATE_DIGITS = 3
#: The metric that weighs error, steering and departures as the environment does.
RETURN = "return"
#: Share of the reference's mean below which a difference is a tie, however sure it is.
SMALLEST_SHARE = 0.01
#: What stands for the training seed in the name that seeds share.
_ANY_SEED = "-seed*"


def columns_of(rows: Sequence[Mapping[str, Any]]) -> tuple[Metric, ...]:
    """The metrics of a scenario's policies. The first one is what differences are of."""
    return tuple(METRICS[key] for key in rows[0]["metrics"])


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
    seeds of one policy are one row, whose intervals are over seeds and episodes. ``parts`` has the names of scenarios
    that the same policies drive (`Suite.parts`); where there are several, each has its reference, the first that drives
    it, ``reference`` is None, and runs have no probability of improvement over the whole.

    Raises:
        ValueError: a policy has no results on a scenario, or not those of the reference's episodes.
    """
    table: dict[tuple[str, str], list[EpisodeResult]] = {}
    for result in results:
        table.setdefault((result.scenario, result.policy), []).append(result)
    whole = not suite.per_environment
    found: dict[str, dict[str, Any]] = {}
    for part in suite.parts.values():
        those = [name for name in policies if whole or any((scenario.name, name) in table for scenario in part)]
        found |= {scenario.name: _scenario(scenario, table, those) for scenario in part if those}
    scenarios = [found[scenario.name] for scenario in suite.scenarios if scenario.name in found]
    parts = {name: [scenario.name for scenario in part if scenario.name in found] for name, part in suite.parts.items()}
    rows = rows_of(policies)
    any_line = next(iter(table.values()))[0]
    return {
        "suite": suite.name,
        "description": suite.description,
        "version": any_line.version,
        "seed": any_line.seed,
        "episodes": max(map(len, table.values())),
        "confidence": CONFIDENCE,
        "resamples": RESAMPLES,
        "reference": next(iter(rows)) if whole else None,
        "parts": {name: names for name, names in parts.items() if names},
        "scenarios": scenarios,
        "improvement": _improvement(suite, table, rows) if whole else {},
    }


def _scenario(
    scenario: SuiteScenario, table: Mapping[tuple[str, str], Sequence[EpisodeResult]], policies: Sequence[str]
) -> dict[str, Any]:
    for name in policies:
        if (scenario.name, name) not in table:
            raise ValueError(f"{scenario.name}: there are no results of {name}")
    by_policy = {name: sorted(table[scenario.name, name], key=lambda result: result.episode) for name in policies}
    first = by_policy[policies[0]]
    for name, lines in by_policy.items():
        if [line.episode_seed for line in lines] != [line.episode_seed for line in first]:
            raise ValueError(f"{scenario.name}: {name} and {policies[0]} have not driven the same episodes")
    rows = rows_of(policies)
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "scenario_hash": first[0].scenario_hash,
        "env_id": scenario.env_id,
        "keywords": dict(scenario.keywords),
        "told": dict(scenario.told),
        "options": dict(scenario.options),
        "max_episode_steps": scenario.max_episode_steps,
        "policies": summarise_rows([[by_policy[name] for name in row] for row in rows.values()], list(rows)),
    }


def parts_of(summary: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """A summary of each part of a run, whose scenarios the same policies drive, by its name; as a rule there is one."""
    found = {}
    for name, names in summary["parts"].items():
        scenarios = [entry for entry in summary["scenarios"] if entry["scenario"] in names]
        found[name] = {**summary, "scenarios": scenarios, "reference": scenarios[0]["policies"][0]["policy"]}
    return found


def _improvement(
    suite: Suite, table: Mapping[tuple[str, str], Sequence[EpisodeResult]], rows: Mapping[str, Sequence[str]]
) -> dict[str, dict[str, float | None]]:
    """How likely a training run beats one of the reference: of the rows with seeds, or all where the reference has."""

    def scores(row: Sequence[str]) -> NDArray[np.float64]:
        return np.array([[_score(table[scenario.name, name]) for scenario in suite.scenarios] for name in row])

    reference, *others = rows.items()
    return {
        label: _plain(probability_of_improvement(scores(row), scores(reference[1]), np.random.default_rng(0)))
        for label, row in others
        if len(row) > 1 or len(reference[1]) > 1
    }


def _score(lines: Sequence[EpisodeResult]) -> float:
    """Mean return of the lines, or what the first metric makes of one."""
    key = RETURN if RETURN in lines[0].metrics else next(iter(lines[0].metrics))
    return (1.0 if METRICS[key].more_is_better else -1.0) * float(np.mean([line.metrics[key] for line in lines]))


def summarise_rows(rows: Sequence[Sequence[Sequence[EpisodeResult]]], labels: Sequence[str]) -> list[dict[str, Any]]:
    """Intervals of one scenario for rows of training seeds of result lines.

    One bootstrap serves all columns, which makes the differences paired; only where there are several training seeds,
    their own interval takes its place.
    """
    keys = list(rows[0][0][0].metrics)
    samples = [np.array([[_numbers(line, keys) for line in lines] for lines in row]) for row in rows]
    values = np.array([sample.mean(axis=0) for sample in samples])
    stacked = np.concatenate([values, values - values[:1]], axis=2)[:, :, [*_both(len(keys))]]
    count, episodes, width = stacked.shape
    flat = stacked.transpose(1, 0, 2).reshape(episodes, count * width)
    intervals = means(flat, np.random.default_rng(0))
    won = _won(values, METRICS[keys[0]].more_is_better)
    summary = []
    for index, (label, row, sample) in enumerate(zip(labels, rows, samples, strict=True)):
        mine = intervals[index * width : (index + 1) * width]
        own, difference = mine[: len(keys)], mine[len(keys) :]
        failed = sample[:, :, -1]
        failures = int(failed.sum())
        own = [
            wilson(float(sample[0, :, place].sum()), episodes) if METRICS[key].how == "ever" else one
            for place, (key, one) in enumerate(zip(keys, own, strict=True))
        ]
        if len(row) > 1:
            own = [seeds_mean(sample[:, :, place]) for place in range(len(keys))]
        own, middles = ([*map(_possible, keys, found)] for found in (own, _middles(sample[:, :, :-1])))
        if len(row) > 1 or len(rows[0]) > 1:
            difference = [seeds_mean(sample[:, :, place], samples[0][:, :, place]) for place in range(len(keys) + 1)]
        else:
            difference = [*difference, paired_rates(failed[0] > 0.0, samples[0][0, :, -1] > 0.0)]
        compared = dict(zip([*keys, RATE], difference, strict=True))
        summary.append(
            {
                "policy": label,
                "seeds": len(row),
                "failures": failures,
                "failure_rate": _plain(wilson(failures, episodes) if len(row) == 1 else seeds_rate(failed)),
                "won": _plain(wilson(min(float(won[index].sum()), episodes), episodes)),
                "metrics": dict(zip(keys, map(_plain, own), strict=True)),
                "interquartile_mean": dict(zip(keys, map(_plain, middles), strict=True)),
                "median": dict(zip(keys, np.median(sample[:, :, :-1], axis=(0, 1)).tolist(), strict=True)),
                "difference_to_reference": {key: _plain(one) for key, one in compared.items()} if index else None,
                "verdict": {
                    key: _verdict(key, one, float(values[0, :, place].mean()), episodes)
                    for place, (key, one) in enumerate(compared.items())
                }
                if index
                else None,
            }
        )
    return summary


def _both(metrics: int) -> list[int]:
    """Places of the metrics and of their differences beside the failures and theirs."""
    return [*range(metrics), *range(metrics + 1, 2 * metrics + 1)]


def _numbers(line: EpisodeResult, keys: Sequence[str]) -> list[float]:
    """The metrics and, at the end, 1 where the episode failed."""
    return [*(line.metrics[key] for key in keys), float(line.failed)]


def _possible(key: str, interval: Interval) -> Interval:
    """An interval cut where the metric ends: Student's, of few episodes, does not know that errors have no sign."""
    low, high = METRICS[key].possible
    return replace(interval, low=max(interval.low, low), high=min(interval.high, high))


def _middles(sample: NDArray[np.float64]) -> list[Interval]:
    """Interquartile means of (seeds, episodes, metrics); of several seeds theirs, with Student's interval."""
    if len(sample) == 1:
        return interquartile_means(sample[0])
    return student_means(np.array([[one.value for one in interquartile_means(seed)] for seed in sample]))


def _won(values: NDArray[np.float64], more_is_better: bool) -> NDArray[np.float64]:
    """Share of each episode that each row has won, (rows, episodes), by the first metric; more failures lose."""
    failed = values[:, :, -1]
    score = values[:, :, 0] if more_is_better else -values[:, :, 0]
    fewest = failed == failed.min(axis=0)
    best = fewest & (score == np.where(fewest, score, -np.inf).max(axis=0))
    return best / best.sum(axis=0)


def _verdict(key: str, difference: Interval, reference: float, episodes: int) -> str:
    """Whether a paired difference is "better" or "worse" than zero beyond its interval, or a "tie".

    What the tables show as 0.000 is a tie however narrow its interval is, and so is less than a hundredth of the
    reference's mean; of few episodes all is.
    """
    digits = RATE_DIGITS if key == RATE else METRICS[key].digits
    smallest = max(0.5 * 10.0**-digits, 0.0 if key == RATE else SMALLEST_SHARE * abs(reference))
    sure = difference.low > 0.0 or difference.high < 0.0  # False of NaN, too
    if episodes < MARKS_FROM or abs(difference.value) < smallest or not sure:
        return "tie"
    more_is_better = key != RATE and METRICS[key].more_is_better
    return "better" if (difference.value > 0.0) == more_is_better else "worse"


def _plain(interval: Interval) -> dict[str, float | None]:
    """As JSON has it: null instead of NaN."""
    return {key: None if math.isnan(value) else value for key, value in asdict(interval).items()}
