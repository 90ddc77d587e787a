"""How often the 95 % intervals hold the truth: python -m lanekeep_benchmarks.coverage prints the table of the README.

Synthetic repeats with known truth, of the shapes that errors have: normal, skewed (a lognormal of sigma 1), and of two
kinds (in one episode of ten the error is ten times as large: a car that left its lane).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_benchmarks.seeds import probability_of_improvement, seeds_mean
from lanekeep_benchmarks.statistics import (
    Interval,
    bootstrap_means,
    interquartile_means,
    paired_rates,
    student_means,
    studentised_means,
    wilson,
)

Floats = NDArray[np.float64]
REPEATS = 10_000
EPISODES = (5, 10, 20, 50, 100, 256)
SEEDS = (3, 5, 10)
#: Repeats that are drawn together, which bounds the memory.
_BLOCK = 500


class Row(NamedTuple):
    """How often an interval held the truth, in percent, for each number in ``of``."""

    interval: str
    shape: str
    of: tuple[int, ...]
    percent: tuple[float, ...]


def _normal(generator: np.random.Generator, size: Any) -> Floats:
    return generator.normal(1.0, 1.0, size)


def _skewed(generator: np.random.Generator, size: Any) -> Floats:
    return generator.lognormal(0.0, 1.0, size)


def _mixed(generator: np.random.Generator, size: Any) -> Floats:
    wide = generator.random(size) < 0.1
    return np.where(wide, 2.0, 0.2) * (1.0 + generator.exponential(0.5, size))


#: Shapes, each with its true mean and interquartile mean (of a skewed one: from its distribution function).
SHAPES: dict[str, tuple[Callable[[np.random.Generator, Any], Floats], float]] = {
    "normal": (_normal, 1.0),
    "skewed": (_skewed, float(np.exp(0.5))),
    "some depart": (_mixed, (0.9 * 0.2 + 0.1 * 2.0) * 1.5),
}


def true_interquartile_mean(name: str) -> float:
    """Mean of the middle half of a shape."""
    from scipy import integrate, stats

    if name == "normal":
        return 1.0
    if name == "skewed":
        return float(2.0 * integrate.quad(stats.lognorm(1.0).ppf, 0.25, 0.75)[0])
    # Below 2 m, where all wide ones are, the distribution is that of the narrow ones: 0.9 of all.
    narrow = stats.expon(loc=0.2, scale=0.1)
    return float(2.0 * integrate.quad(lambda share: narrow.ppf(share / 0.9), 0.25, 0.75)[0])


def _held(intervals: list[Interval], truth: float) -> int:
    return sum(interval.low <= truth <= interval.high for interval in intervals)


def _blocks(repeats: int) -> Iterator[int]:
    for start in range(0, repeats, _BLOCK):
        yield min(_BLOCK, repeats - start)


def means_rows(repeats: int, generator: np.random.Generator) -> Iterator[Row]:
    """Student's interval, the bootstrap and the interquartile mean's of episodes, or of paired differences."""
    kinds: dict[str, Callable[[Floats], list[Interval]]] = {
        "mean, Student's": student_means,
        "mean, bootstrap": lambda values: bootstrap_means(values, generator, resamples=2000),
        "mean, studentised bootstrap": lambda values: studentised_means(values, generator, resamples=2000),
        "interquartile mean": interquartile_means,
    }
    for kind, interval in kinds.items():
        for name, (draw, mean) in SHAPES.items():
            truth = true_interquartile_mean(name) if kind.startswith("inter") else mean
            found = []
            for episodes in EPISODES:
                hits = sum(_held(interval(draw(generator, (episodes, size))), truth) for size in _blocks(repeats))
                found.append(100.0 * hits / repeats)
            yield Row(kind, name, EPISODES, tuple(found))


def rates_rows(repeats: int, generator: np.random.Generator) -> Iterator[Row]:
    """Wilson's interval."""
    for rate in (0.02, 0.1, 0.5):
        found = []
        for episodes in EPISODES:
            counts = generator.binomial(episodes, rate, repeats)
            intervals = [wilson(failures, episodes) for failures in range(episodes + 1)]
            found.append(100.0 * _held([intervals[count] for count in counts], rate) / repeats)
        yield Row("rate, Wilson's", f"{100 * rate:.0f} %", EPISODES, tuple(found))
    for ours, theirs in ((0.02, 0.05), (0.1, 0.3), (0.5, 0.5)):
        found = []
        for episodes in EPISODES:
            # The worse the road, the more of both leave it.
            road = generator.random((repeats, episodes))
            mine, yours = (
                np.where(road < 0.5, 1.5, 0.5) * rate > generator.random(road.shape) for rate in (ours, theirs)
            )
            found.append(
                100.0 * _held([paired_rates(a, b) for a, b in zip(mine, yours, strict=True)], ours - theirs) / repeats
            )
        yield Row("difference of rates, paired", f"{100 * ours:.0f} % − {100 * theirs:.0f} %", EPISODES, tuple(found))


def seeds_rows(repeats: int, generator: np.random.Generator) -> Iterator[Row]:
    """Training seeds against an untrained policy on 64 episodes: mean difference, probability of improvement."""
    for spread in (0.1, 1.0):
        found = []
        for seeds in SEEDS:
            hits = 0
            for _ in range(repeats):
                road = generator.normal(0.0, 5.0, 64)
                ours = 1.0 + spread * generator.normal(size=(seeds, 1)) + road + generator.normal(size=(seeds, 64))
                hits += _held([seeds_mean(ours, (road + generator.normal(size=64))[None])], 1.0)
            found.append(100.0 * hits / repeats)
        yield Row("difference over seeds", f"seeds spread {spread:g}", SEEDS, tuple(found))
    for kind, few in (("placements", 10**6), ("stratified bootstrap", 0)):
        for scenarios in (1, 5):
            found = []
            for seeds in SEEDS:
                hits = 0
                for _ in range(repeats):
                    size = (seeds, scenarios)
                    ours, theirs = generator.normal(0.5, 1.0, size), generator.normal(size=size)
                    hits += _held([probability_of_improvement(ours, theirs, generator, 400, few)], _IMPROVES)
                found.append(100.0 * hits / repeats)
            what = f"{scenarios} scenario{'s' * (scenarios > 1)}"
            yield Row(f"probability of improvement, {kind}", what, SEEDS, tuple(found))


#: P(X > Y) of normal scores half a standard deviation apart.
_IMPROVES = 0.6381631950841185


def table(repeats: int = REPEATS) -> str:
    """The table, as Markdown."""
    lines = []
    for heading, rows in (("episodes", [*_rows(repeats, means_rows), *_rows(repeats, rates_rows)]),
                          ("training seeds", _rows(repeats, seeds_rows))):  # fmt: skip
        lines += [f"| interval | of | {' | '.join(f'{n} {heading}' for n in rows[0].of)} |"]
        lines += [f"|---|---|{'---:|' * len(rows[0].of)}"]
        for row in rows:
            shown = (f"{percent:.1f}" if 93.0 <= percent <= 97.0 else f"*{percent:.1f}*" for percent in row.percent)
            lines.append(f"| {row.interval} | {row.shape} | {' | '.join(shown)} |")
        lines.append("")
    return "\n".join(lines)


def _rows(repeats: int, kind: Callable[[int, np.random.Generator], Iterator[Row]]) -> list[Row]:
    return list(kind(repeats, np.random.default_rng(20)))


if __name__ == "__main__":
    print(table())
