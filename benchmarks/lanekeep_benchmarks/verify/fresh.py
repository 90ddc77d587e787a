"""Episodes that nobody could know: their seed is drawn when it is verified, and every policy starts anew for them."""

from __future__ import annotations

import secrets
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_benchmarks.evaluate import Batch, Driver
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.metrics import METRICS
from lanekeep_benchmarks.own_code import OwnCodeError
from lanekeep_benchmarks.statistics import Interval, unpaired_means
from lanekeep_benchmarks.summary import RETURN
from lanekeep_benchmarks.verify.claims import Claims

#: Episodes of each policy and scenario.
EPISODES = 32
#: How likely an honest run is accused, over all its policies and scenarios together.
LEVEL = 0.01


class Fresh(NamedTuple):
    """A policy's scores on a scenario: claimed, on fresh episodes, and the difference with its interval.

    ``key`` is the metric. ``probability``: that fresh episodes come out so much worse by chance. ``failed`` has the
    failure rates, claimed and fresh. ``error``: where its code failed.
    """

    scenario: str
    policy: str
    key: str = ""
    claimed: float = float("nan")
    fresh: float = float("nan")
    difference: Interval | None = None
    failed: tuple[float, float] = (0.0, 0.0)
    probability: float = 1.0
    error: str = ""

    def worse(self, comparisons: int) -> bool:
        """Whether it is worse than claimed, beyond what chance does in so many comparisons (Bonferroni)."""
        return self.probability < LEVEL / comparisons


def drive_fresh(claims: Claims) -> tuple[int, Iterator[Fresh]]:
    """Return the seed that was drawn, and what comes of its episodes, scenario by scenario.

    Own code gets another process, which has seen none of the episodes that were driven again.
    """
    claims.close()
    seed = secrets.randbits(53)
    return seed, _fresh(claims, seed, range(EPISODES))


def _fresh(claims: Claims, seed: int, numbers: Sequence[int]) -> Iterator[Fresh]:
    plan = claims.plan
    driver = Driver(plan.suite.name, seed, plan.policy)
    claimed: dict[tuple[str, str], list[EpisodeResult]] = {}
    for line in claims.lines.values():
        claimed.setdefault((line.scenario, line.policy), []).append(line)
    for scenario in plan.suite.scenarios:
        for policy in plan.drivers[scenario.name]:
            if (scenario.name, policy) not in claimed:
                continue
            try:
                lines = driver.drive(Batch(scenario, policy, numbers, frozenset(numbers))).results
            except OwnCodeError as error:
                yield Fresh(scenario.name, policy, error=str(error))
                continue
            yield compared(claimed[scenario.name, policy], lines)
    driver.close()


def compared(claimed: Sequence[EpisodeResult], fresh: Sequence[EpisodeResult]) -> Fresh:
    """Compare a policy's lines of a scenario: the return, or the first metric where the task has none.

    Source: H. B. Mann and D. R. Whitney, On a test of whether one of two random variables is stochastically larger than
    the other, Annals of Mathematical Statistics 18 (1947): ranks, so that whatever the scores' distribution is, an
    honest policy, whose episodes are of one kind, is accused as rarely as stated.
    """
    from scipy.stats import mannwhitneyu

    keys = list(fresh[0].metrics)
    key = RETURN if RETURN in keys else keys[0]
    there, here = _values(claimed, key), _values(fresh, key)
    worse = "less" if METRICS[key].more_is_better else "greater"
    return Fresh(
        fresh[0].scenario,
        fresh[0].policy,
        key,
        float(there.mean()),
        float(here.mean()),
        unpaired_means(here, there),
        (float(np.mean([line.failed for line in claimed])), float(np.mean([line.failed for line in fresh]))),
        float(mannwhitneyu(here, there, alternative=worse).pvalue),
    )


def _values(lines: Sequence[EpisodeResult], key: str) -> NDArray[np.float64]:
    return np.array([line.metrics[key] for line in lines], dtype=np.float64)
