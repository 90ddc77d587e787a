"""Training seeds of one policy: intervals over seeds and episodes, and how likely a run beats another policy's."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lanekeep_benchmarks.statistics import CONFIDENCE, RESAMPLES, Interval, composed, wilson

#: Runs, over all scenarios, below which the bootstrap over runs is too narrow.
FEW_RUNS = 30


def probability_of_improvement(
    ours: NDArray[np.float64],
    theirs: NDArray[np.float64],
    generator: np.random.Generator,
    resamples: int = RESAMPLES,
    few: int = FEW_RUNS,
) -> Interval:
    """How likely a run of ours has the higher score than one of theirs, on a scenario drawn by chance.

    The interval is the bootstrap's that draws runs anew for each scenario by itself (stratified); with few runs, whose
    bootstrap is too narrow (`coverage`), or where all pairs end alike, a wider one from the spread of the runs'
    own probabilities.

    Args:
        ours, theirs: (seeds, scenarios), scores of training runs, of which more is better; ties count half.
        generator: source of the resamples.
        resamples: number of bootstrap resamples.
        few: runs, over all scenarios, below which the wider interval is taken; 0 for the bootstrap always.

    Raises:
        ValueError: the scenarios are not as many, or there are none.

    Source: R. Agarwal, M. Schwarzer, P. S. Castro, A. Courville and M. G. Bellemare, Deep reinforcement learning at the
    edge of the statistical precipice, NeurIPS 2021, section 4.3: Mann and Whitney's U over the pairs of a scenario, and
    the mean over scenarios. No interval where neither has a second run.
    """
    if ours.shape[1] != theirs.shape[1] or not ours.size or not theirs.size:
        raise ValueError(f"{[ours.shape, theirs.shape]} are not allowed: as many scenarios of both, >= 1 run")
    wins = (np.sign(ours[:, None] - theirs[None]) + 1.0) / 2.0  # (seeds, seeds, scenarios)
    value = float(wins.mean())
    runs = min((len(policy) for policy in (ours, theirs) if len(policy) > 1), default=1)
    if runs < 2:
        return Interval(value, math.nan, math.nan)
    alike = not wins.std(axis=(0, 1)).any()  # no resample differs, and a bootstrap would have no doubt
    if runs * ours.shape[1] < few or alike:
        return _from_placements(wins, runs)
    counts = [
        generator.multinomial(len(policy), np.full(len(policy), 1.0 / len(policy)), (resamples, policy.shape[1]))
        / len(policy)
        for policy in (ours, theirs)
    ]
    drawn = np.einsum("rki,rkj,ijk->r", *counts, wins, optimize=True) / ours.shape[1]
    low, high = np.quantile(drawn, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Interval(value, float(low), float(high))


def _from_placements(wins: NDArray[np.float64], runs: int) -> Interval:
    """Student's interval of the logit of a mean of ``wins`` (seeds, seeds, scenarios).

    Source: E. Brunner and U. Munzel, The nonparametric Behrens-Fisher problem, Biometrical Journal 42 (2000). Ours:
    half a win is added, and the variance is at least a third of the largest there can be, as few runs may all agree.
    """
    from scipy.stats import t

    scenarios = wins.shape[2]
    parts, freedoms = [], []
    for axis in (0, 1):
        placements = wins.mean(axis=1 - axis)
        if len(placements) > 1:
            parts += list(placements.var(axis=0, ddof=1) / len(placements) / scenarios**2)
            freedoms += [len(placements) - 1] * scenarios
    share = (wins.sum() + 0.5) / (wins.size + 1.0)
    least = share * (1.0 - share) / (3.0 * runs * scenarios)
    variance = max(sum(parts), least)
    freedom = (runs - 1) * scenarios
    if variance > least:
        freedom = max(variance**2 / sum(part**2 / free for part, free in zip(parts, freedoms, strict=True)), runs - 1)
    half = t.ppf((1 + CONFIDENCE) / 2, freedom) * math.sqrt(variance) / (share * (1.0 - share))
    middle = math.log(share / (1.0 - share))
    value = float(wins.mean())
    low, high = (1.0 / (1.0 + math.exp(-(middle + end))) for end in (-half, half))
    return Interval(value, min(low, value), max(high, value))


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

    Where only seeds differ it is Welch's interval, where only episodes differ Student's paired one.
    """
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
    return composed(value, parts, confidence)


def seeds_rate(failed: NDArray[np.float64], confidence: float = CONFIDENCE) -> Interval:
    """Failure rate of (seeds, episodes) that are 1 where the episode failed, else 0.

    At least as wide as Wilson's over the episodes, which are the same for all seeds; wider where the seeds differ.
    """
    of_episodes = wilson(float(failed.mean(axis=0).sum()), failed.shape[1], confidence)
    of_seeds = seeds_mean(failed, confidence=confidence)
    # NaN of one episode loses against either bound.
    low, high = np.fmin(of_episodes.low, of_seeds.low), np.fmax(of_episodes.high, of_seeds.high)
    return Interval(of_episodes.value, max(0.0, float(low)), min(1.0, float(high)))
