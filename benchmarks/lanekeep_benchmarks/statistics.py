"""Intervals for a handful of paired episodes: percentile bootstrap for means, Wilson for rates, t over training seeds.

The bootstrap resamples EPISODES, and the same resamples serve every policy and metric, because all policies drive the
same episodes: a difference of two columns is then a paired difference, without the spread from road to road.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

CONFIDENCE = 0.95
RESAMPLES = 10_000


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
    episodes, columns = values.shape
    if not episodes:
        raise ValueError("values of 0 episodes are not allowed: a mean needs one, an interval two")
    means = values.mean(axis=0)
    if episodes < 2:
        return [Interval(float(mean), math.nan, math.nan) for mean in means]
    resampled = np.empty((resamples, columns))
    block = max(1, 1_000_000 // episodes)  # bounds the memory of the index matrix
    for start in range(0, resamples, block):
        rows = min(block, resamples - start)
        drawn = generator.integers(0, episodes, size=(rows, episodes)) + episodes * np.arange(rows)[:, None]
        # How often each episode was drawn: a weighted sum replaces gathering every column.
        counts = np.bincount(drawn.ravel(), minlength=rows * episodes).reshape(rows, episodes)
        resampled[start : start + rows] = counts @ values / episodes
    tail = (1 - confidence) / 2
    low, high = np.quantile(resampled, [tail, 1 - tail], axis=0)
    return [Interval(float(m), float(a), float(b)) for m, a, b in zip(means, low, high, strict=True)]


def seeds_mean(
    ours: NDArray[np.float64], theirs: NDArray[np.float64] | None = None, confidence: float = CONFIDENCE
) -> Interval:
    """Mean over training seeds and episodes, or its paired difference to another policy's on the same episodes.

    Both are drawn by chance, seeds and episodes, every seed meets every episode, and a handful of seeds is too few to
    resample: the variance is the sum of what episodes and each policy's seeds add, the interval Student's with the
    degrees of freedom of that sum.

    Args:
        ours, theirs: (seeds, episodes), one seed for a policy that was not trained; they need not have as many seeds.
        confidence: of the interval, 0.95 by default.

    Raises:
        ValueError: the policies have not driven the same number of episodes, or none.

    Source: F. E. Satterthwaite, An approximate distribution of estimates of variance components, Biometrics 2 (1946).
    Where only seeds differ it is Welch's interval, where only episodes differ Student's paired one.
    """
    from scipy.stats import t

    policies = [ours] if theirs is None else [ours, theirs]
    episodes = ours.shape[1]
    if not episodes or any(values.shape[1] != episodes for values in policies):
        raise ValueError(f"{[values.shape[1] for values in policies]} episodes are not allowed: as many of each, >= 1")
    means = [values.mean(axis=0) for values in policies]
    each = means[0] if theirs is None else means[0] - means[1]
    value = float(each.mean())
    if episodes < 2:
        return Interval(value, math.nan, math.nan)
    parts = [(each.var(ddof=1) / episodes, episodes - 1)]
    for values, mean in zip(policies, means, strict=True):
        seeds = len(values)
        if seeds > 1:
            of_seed = values.mean(axis=1)
            rest = values - of_seed[:, None] - mean + mean.mean()
            # What a seed does to an episode is in the episodes' part already.
            both = np.sum(rest**2) / ((seeds - 1) * (episodes - 1)) / (seeds * episodes)
            parts.append((max(of_seed.var(ddof=1) / seeds - both, 0.0), seeds - 1))
    variance = sum(part for part, _ in parts)
    if not variance > 0.0:
        return Interval(value, value, value)
    freedom = variance**2 / sum(part**2 / free for part, free in parts)
    half = float(t.ppf(0.5 + confidence / 2, freedom) * math.sqrt(variance))
    return Interval(value, value - half, value + half)


def seeds_rate(failed: NDArray[np.float64], confidence: float = CONFIDENCE) -> Interval:
    """Failure rate of (seeds, episodes) that are 1 where the episode failed, else 0.

    At least as wide as Wilson's over the episodes, which are the same for all seeds; wider where the seeds differ.
    """
    of_episodes = wilson(float(failed.mean(axis=0).sum()), failed.shape[1], confidence)
    of_seeds = seeds_mean(failed, confidence=confidence)
    # NaN of one episode loses against either bound.
    low, high = np.fmin(of_episodes.low, of_seeds.low), np.fmax(of_episodes.high, of_seeds.high)
    return Interval(of_episodes.value, max(0.0, float(low)), min(1.0, float(high)))
