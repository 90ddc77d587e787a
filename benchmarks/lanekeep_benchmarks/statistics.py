"""Intervals for a handful of paired episodes: percentile bootstrap for means, Wilson for rates.

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


def wilson(failures: int, episodes: int, confidence: float = CONFIDENCE) -> Interval:
    """Failure rate with Wilson's score interval, which stays sane at 0 and at 100 %.

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
