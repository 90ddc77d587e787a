"""Intervals for paired episodes: Student's or a bootstrap for means, Wilson's for rates, t over training seeds.

Which is used for how many episodes is what `coverage` has found to hold 95 %: benchmarks/README.md has its table.

The bootstrap resamples EPISODES, and the same resamples serve every policy and metric, because all policies drive the
same episodes: a difference of two columns is then a paired difference, without the spread from road to road.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

CONFIDENCE = 0.95
RESAMPLES = 10_000
#: Episodes from which the studentised bootstrap of a mean covers better than Student's interval.
BOOTSTRAP_FROM = 5
#: Episodes below which no difference is called better or worse.
MARKS_FROM = 10
#: A ratio of the studentised bootstrap as large stands for a resample of equal values.
_NO_SPREAD = 1e3


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval; ``low`` and ``high`` are NaN where one episode allows none."""

    value: float
    low: float
    high: float


def wilson(failures: float, episodes: int, confidence: float = CONFIDENCE) -> Interval:
    """Failure rate with Wilson's score interval, which stays sane at 0 and at 100 %.

    ``failures`` need not be whole: it may be a mean over training seeds.

    Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927).
    """
    if episodes < 1 or not 0 <= failures <= episodes:
        raise ValueError(f"failures={failures} of episodes={episodes} is not allowed: 0 <= failures <= episodes, >= 1")
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    rate = failures / episodes
    scale = 1 + z**2 / episodes
    centre = (rate + z**2 / (2 * episodes)) / scale
    half = z / scale * math.sqrt(rate * (1 - rate) / episodes + z**2 / (4 * episodes**2))
    # At 0 and 1 the bound equals the rate; rounding must not push it past.
    low = 0.0 if failures == 0 else centre - half
    high = 1.0 if failures == episodes else centre + half
    return Interval(rate, low, high)


def paired_rates(ours: NDArray[np.bool_], theirs: NDArray[np.bool_], confidence: float = CONFIDENCE) -> Interval:
    """Difference of two failure rates on the same episodes, (episodes,) each, ours minus theirs.

    Source: R. G. Newcombe, Improved confidence intervals for the difference between binomial proportions based on
    paired data, Statistics in Medicine 17 (1998), method 10: Wilson's, squared and added, with their correlation.
    """
    episodes = len(ours)
    first, second = wilson(int(ours.sum()), episodes, confidence), wilson(int(theirs.sum()), episodes, confidence)
    both, neither = int((ours & theirs).sum()), int((~ours & ~theirs).sum())
    mine, yours = int((ours & ~theirs).sum()), int((theirs & ~ours).sum())
    product = (both + mine) * (yours + neither) * (both + yours) * (mine + neither)
    excess: float = both * neither - mine * yours
    if excess > 0:  # corrected for continuity
        excess = max(excess - episodes / 2, 0.0)
    phi = excess / math.sqrt(product) if product else 0.0

    def bound(mine: float, yours: float) -> float:
        return math.sqrt(max(mine**2 - 2 * phi * mine * yours + yours**2, 0.0))

    value = first.value - second.value
    low = value - bound(first.value - first.low, second.high - second.value)
    high = value + bound(first.high - first.value, second.value - second.low)
    return Interval(value, low, high)


def bootstrap_means(
    values: NDArray[np.float64],
    generator: np.random.Generator,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
) -> list[Interval]:
    """Mean of each column with its percentile bootstrap interval.

    Args:
        values: (episodes, columns); one row holds everything measured on one episode, by all policies.
        generator: source of the resamples.
        confidence: of the interval, 0.95 by default.
        resamples: number of bootstrap resamples.

    Returns:
        One Interval a column.

    Raises:
        ValueError: there is no episode.

    Source: B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap (1993), chapter 13.
    """
    values = np.asarray(values, dtype=np.float64)
    means = _means_of(values)
    if len(values) < 2:
        return [Interval(float(mean), math.nan, math.nan) for mean in means]
    resampled = np.concatenate([drawn @ values for drawn in _draws(len(values), generator, resamples)])
    tail = (1 - confidence) / 2
    low, high = np.quantile(resampled, [tail, 1 - tail], axis=0)
    return [Interval(float(m), float(a), float(b)) for m, a, b in zip(means, low, high, strict=True)]


def studentised_means(
    values: NDArray[np.float64],
    generator: np.random.Generator,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
) -> list[Interval]:
    """Mean of each column with its studentised bootstrap interval, which knows of skewed samples.

    Arguments, result and errors are those of `bootstrap_means`. Student's interval where too few episodes differ for a
    spread in nearly every resample.

    Source: B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap (1993), chapter 12.5 (bootstrap-t).
    """
    values = np.asarray(values, dtype=np.float64)
    means = _means_of(values)
    plain = student_means(values, confidence)
    if len(values) < 2:
        return plain
    centred = values - means
    error = values.std(axis=0, ddof=1) / math.sqrt(len(values))
    # Equal values have no spread but rounding's.
    spread = error > 1e-12 * np.abs(means)
    ratios = []
    for drawn in _draws(len(values), generator, resamples):
        mean = drawn @ centred
        variance = drawn @ (centred * centred) - mean * mean
        variance[variance < 1e-12 * error**2] = 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = mean / np.sqrt(variance / (len(values) - 1))
        ratios.append(np.clip(np.nan_to_num(ratio, nan=2 * _NO_SPREAD), -2 * _NO_SPREAD, 2 * _NO_SPREAD))
    tail = (1 - confidence) / 2
    low, high = np.quantile(np.concatenate(ratios), [tail, 1 - tail], axis=0)
    some = spread & (np.maximum(-low, high) < _NO_SPREAD)
    return [
        Interval(float(m), float(m - b * e), float(m - a * e)) if use else student
        for m, a, b, e, use, student in zip(means, low, high, error, some, plain, strict=True)
    ]


def _means_of(values: NDArray[np.float64]) -> NDArray[np.float64]:
    if not len(values):
        raise ValueError("values of 0 episodes are not allowed: a mean needs one, an interval two")
    means: NDArray[np.float64] = values.mean(axis=0)
    return means


def _draws(episodes: int, generator: np.random.Generator, resamples: int) -> Iterator[NDArray[np.float64]]:
    """Yield resamples in blocks (rows, episodes) as weights: how often each episode was drawn, over their number."""
    block = max(1, 1_000_000 // episodes)  # bounds the memory of the index matrix
    for start in range(0, resamples, block):
        rows = min(block, resamples - start)
        drawn = generator.integers(0, episodes, size=(rows, episodes)) + episodes * np.arange(rows)[:, None]
        # A weighted sum replaces gathering every column.
        counts = np.bincount(drawn.ravel(), minlength=rows * episodes).reshape(rows, episodes)
        yield counts / episodes


def means(values: NDArray[np.float64], generator: np.random.Generator) -> list[Interval]:
    """Mean of each column (episodes, columns) with the interval that covers better for as many episodes."""
    few = len(values) < BOOTSTRAP_FROM
    return student_means(values) if few else studentised_means(values, generator)


def student_means(values: NDArray[np.float64], confidence: float = CONFIDENCE, trimmed: float = 0.0) -> list[Interval]:
    """Mean of each column with Student's interval, or that of what is left without its smallest and largest.

    Args:
        values: (episodes, columns).
        confidence: of the interval, 0.95 by default.
        trimmed: share that is left out at either end; 0.25 gives the interquartile mean.

    Raises:
        ValueError: there is no episode.

    Source: J. W. Tukey and D. H. McLaughlin, Less vulnerable confidence and significance procedures for location based
    on a single sample, Sankhya A 25 (1963): the variance is that of the winsorised sample.
    """
    from scipy.stats import t

    values = np.sort(np.asarray(values, dtype=np.float64), axis=0) if trimmed else np.asarray(values, dtype=np.float64)
    episodes = len(values)
    if not episodes:
        raise ValueError("values of 0 episodes are not allowed: a mean needs one, an interval two")
    cut = int(trimmed * episodes)
    kept = episodes - 2 * cut
    centre = values[cut : episodes - cut].mean(axis=0)
    if kept < 2:
        return [Interval(float(mean), math.nan, math.nan) for mean in centre]
    winsorised = np.clip(values, values[cut], values[episodes - 1 - cut]) if cut else values
    squares = ((winsorised - winsorised.mean(axis=0)) ** 2).sum(axis=0)
    half = float(t.ppf(0.5 + confidence / 2, kept - 1)) * np.sqrt(squares / (kept * (kept - 1)))
    return [Interval(float(m), float(m - h), float(m + h)) for m, h in zip(centre, half, strict=True)]


def interquartile_means(values: NDArray[np.float64]) -> list[Interval]:
    """Mean of the middle half of each column (episodes, columns), with its interval."""
    return student_means(values, trimmed=0.25)


def performance_profile(values: NDArray[np.float64], thresholds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of ``values`` above each threshold.

    Source: R. Agarwal, M. Schwarzer, P. S. Castro, A. Courville and M. G. Bellemare, Deep reinforcement learning at the
    edge of the statistical precipice, NeurIPS 2021, equation 1 (score distributions).
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64), axis=None)
    return 1.0 - np.searchsorted(ordered, thresholds, side="right") / ordered.size


def unpaired_means(ours: NDArray[np.float64], theirs: NDArray[np.float64], confidence: float = CONFIDENCE) -> Interval:
    """Difference of two means over different episodes, ours minus theirs, with Welch's interval.

    Source: B. L. Welch, The generalization of 'Student's' problem when several different population variances are
    involved, Biometrika 34 (1947).
    """
    value = float(ours.mean() - theirs.mean())
    if min(len(ours), len(theirs)) < 2:
        return Interval(value, math.nan, math.nan)
    return composed(value, [(one.var(ddof=1) / len(one), len(one) - 1) for one in (ours, theirs)], confidence)


def composed(value: float, parts: Sequence[tuple[float, int]], confidence: float = CONFIDENCE) -> Interval:
    """Interval of an estimate whose variance is the sum of ``parts``, each with its degrees of freedom.

    Source: F. E. Satterthwaite, An approximate distribution of estimates of variance components, Biometrics 2 (1946).
    """
    from scipy.stats import t

    variance = sum(part for part, _ in parts)
    if not variance > 0.0:
        return Interval(value, value, value)
    freedom = variance**2 / sum(part**2 / free for part, free in parts)
    half = float(t.ppf(0.5 + confidence / 2, freedom) * math.sqrt(variance))
    return Interval(value, value - half, value + half)
