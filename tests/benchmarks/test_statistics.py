"""The intervals against scipy, closed forms and a coverage simulation."""

import math

import numpy as np
import pytest
from scipy import stats

from lanekeep_benchmarks.seeds import probability_of_improvement, seeds_mean, seeds_rate
from lanekeep_benchmarks.statistics import (
    Interval,
    bootstrap_means,
    interquartile_means,
    paired_rates,
    performance_profile,
    student_means,
    studentised_means,
    wilson,
)


@pytest.mark.parametrize(("failures", "episodes"), [(0, 1), (0, 20), (1, 20), (7, 64), (63, 64), (64, 64), (3, 1000)])
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_wilson_equals_scipy(failures, episodes, confidence):
    ours = wilson(failures, episodes, confidence)
    theirs = stats.binomtest(failures, episodes).proportion_ci(confidence, method="wilson")
    assert ours.value == failures / episodes
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)
    assert 0.0 <= ours.low <= ours.value <= ours.high <= 1.0


@pytest.mark.parametrize(("failures", "episodes"), [(0, 0), (-1, 5), (6, 5)])
def test_wilson_refuses_impossible_counts(failures, episodes):
    with pytest.raises(ValueError, match=r"failures=.* of episodes=.* is not allowed"):
        wilson(failures, episodes)


def test_bootstrap_agrees_with_scipy():
    sample = np.random.default_rng(3).lognormal(size=60)
    (ours,) = bootstrap_means(sample[:, None], np.random.default_rng(0), resamples=40_000)
    theirs = stats.bootstrap(
        (sample,), np.mean, method="percentile", n_resamples=40_000, rng=np.random.default_rng(1)
    ).confidence_interval
    width = theirs.high - theirs.low
    assert ours.value == pytest.approx(sample.mean(), rel=1e-14)
    assert ours.low == pytest.approx(theirs.low, abs=0.02 * width)
    assert ours.high == pytest.approx(theirs.high, abs=0.02 * width)


def test_bootstrap_of_a_two_point_sample_is_binomial():
    """Resampled means of k ones among n are Binomial(n, k / n) / n exactly."""
    values = np.r_[np.ones(12), np.zeros(28)]
    (ours,) = bootstrap_means(values[:, None], np.random.default_rng(0), resamples=100_000)
    assert ours.low == pytest.approx(stats.binom.ppf(0.025, 40, 0.3) / 40, abs=1e-12)
    assert ours.high == pytest.approx(stats.binom.ppf(0.975, 40, 0.3) / 40, abs=1e-12)


def test_columns_share_their_resamples():
    """A shift common to both columns must vanish from their difference: that is what pairing buys."""
    generator = np.random.default_rng(5)
    road = generator.normal(0.0, 10.0, 50)
    a, b = road + generator.normal(0.0, 0.1, 50), road + generator.normal(0.3, 0.1, 50)
    first, second, difference = bootstrap_means(np.stack([a, b, b - a], axis=1), np.random.default_rng(0))
    assert first.high - first.low > 4.0
    assert difference.high - difference.low < 0.12
    assert difference.value == pytest.approx(second.value - first.value, abs=1e-12)


def test_blocks_cover_all_resamples():
    """More episodes than fit one block of resamples: still a finite interval of the normal width."""
    sample = np.random.default_rng(2).normal(size=4000)
    (ours,) = bootstrap_means(sample[:, None], np.random.default_rng(0), resamples=2000)
    assert ours.high - ours.low == pytest.approx(2 * 1.96 * sample.std() / math.sqrt(4000), rel=0.08)


def test_one_episode_has_no_interval():
    (ours,) = bootstrap_means(np.array([[2.5]]), np.random.default_rng(0))
    assert ours.value == 2.5
    assert math.isnan(ours.low) and math.isnan(ours.high)


def test_no_episode_is_refused():
    with pytest.raises(ValueError, match="values of 0 episodes are not allowed"):
        bootstrap_means(np.empty((0, 3)), np.random.default_rng(0))


@pytest.mark.parametrize(("draw", "truth"), [("normal", 1.0), ("exponential", 1.0)])
def test_coverage_of_the_bootstrap(draw, truth):
    """400 experiments of 64 episodes: a 95 % interval covers the true mean in 91 to 98 of 100."""
    generator = np.random.default_rng(11)
    experiments = 400
    samples = getattr(generator, draw)(1.0, size=(64, experiments))
    intervals = [bootstrap_means(samples[:, [i]], generator, resamples=1000)[0] for i in range(experiments)]
    coverage = np.mean([interval.low <= truth <= interval.high for interval in intervals])
    assert 0.91 <= coverage <= 0.98


def test_coverage_of_wilson():
    """Exact coverage, averaged over rates: close to 95 %, where the textbook (Wald) interval falls to 60 %."""
    episodes, rates = 64, np.linspace(0.01, 0.5, 50)
    hits = np.arange(episodes + 1)
    intervals = [wilson(int(k), episodes) for k in hits]
    low, high = np.array([i.low for i in intervals]), np.array([i.high for i in intervals])
    coverage = [stats.binom.pmf(hits, episodes, p)[(low <= p) & (p <= high)].sum() for p in rates]
    assert np.mean(coverage) == pytest.approx(0.95, abs=0.01)
    assert min(coverage) > 0.87


def test_where_only_seeds_differ_it_is_welchs_interval():
    generator = np.random.default_rng(4)
    a, b = generator.normal(0.0, 1.0, 5), generator.normal(0.5, 3.0, 4)
    ours = seeds_mean(np.tile(a[:, None], 40), np.tile(b[:, None], 40))
    theirs = stats.ttest_ind(a, b, equal_var=False).confidence_interval()
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)
    alone = seeds_mean(np.tile(a[:, None], 40))
    theirs = stats.ttest_1samp(a, 0.0).confidence_interval()
    assert (alone.value, alone.low, alone.high) == pytest.approx((a.mean(), theirs.low, theirs.high), rel=1e-9)


def test_where_only_episodes_differ_it_is_students_paired_interval():
    generator = np.random.default_rng(6)
    road = generator.normal(0.0, 10.0, 30)
    a, b = road + generator.normal(0.2, 0.3, 30), road + generator.normal(0.0, 0.3, 30)
    ours = seeds_mean(np.tile(a, (5, 1)), b[None])
    theirs = stats.ttest_rel(a, b).confidence_interval()
    assert (ours.value, ours.low, ours.high) == pytest.approx((a.mean() - b.mean(), theirs.low, theirs.high), rel=1e-9)


@pytest.mark.parametrize("seed_spread", [0.1, 1.0, 3.0])
def test_coverage_over_seeds_and_episodes(seed_spread):
    """1,000 experiments of 5 seeds against an untrained policy on 32 episodes, both with effects of their own."""
    generator = np.random.default_rng(12)
    hits = 0
    for _ in range(1000):
        road = generator.normal(0.0, 5.0, 32)
        gain = generator.normal(0.0, 1.0, 32)
        seeds = generator.normal(0.0, seed_spread, (5, 1))
        ours = 1.0 + seeds + road + gain + generator.normal(0.0, 1.0, (5, 32))
        interval = seeds_mean(ours, road[None])
        hits += interval.low <= 1.0 <= interval.high
    assert 0.93 <= hits / 1000 <= 0.975


def test_equal_seeds_and_episodes_leave_no_doubt():
    assert seeds_mean(np.full((5, 8), 0.25)) == Interval(0.25, 0.25, 0.25)


def test_one_episode_has_no_interval_over_seeds():
    ours = seeds_mean(np.array([[1.0], [3.0]]))
    assert ours.value == 2.0 and math.isnan(ours.low) and math.isnan(ours.high)


def test_seeds_meet_the_same_episodes():
    with pytest.raises(ValueError, match=r"\[3, 4\] episodes are not allowed"):
        seeds_mean(np.zeros((2, 3)), np.zeros((1, 4)))


def test_the_rate_over_seeds_is_never_narrower_than_wilsons():
    """Five seeds on the same 20 episodes are no hundred episodes; one seed of five that always fails is no 20 %."""
    none = seeds_rate(np.zeros((5, 20)))
    assert none == wilson(0, 20)
    one = np.zeros((5, 20))
    one[2] = 1.0
    uneven, student = seeds_rate(one), stats.ttest_1samp([0, 0, 1, 0, 0], 0.0).confidence_interval()
    assert uneven.value == pytest.approx(0.2)
    assert uneven.low == 0.0 and uneven.high == pytest.approx(student.high, rel=1e-9)


def test_students_interval_and_a_trimmed_means_equal_scipys():
    """Untrimmed it is `ttest_1samp`'s; trimmed, scipy's of the winsorised sample by Tukey and McLaughlin's formula."""
    sample = np.random.default_rng(8).lognormal(size=(41, 2))
    plain = student_means(sample)
    for column, ours in zip(sample.T, plain, strict=True):
        theirs = stats.ttest_1samp(column, 0.0).confidence_interval()
        assert (ours.value, ours.low, ours.high) == pytest.approx((column.mean(), *theirs), rel=1e-9)
    for column, ours in zip(sample.T, interquartile_means(sample), strict=True):
        centre, error = stats.trim_mean(column, 0.25), stats.mstats.trimmed_stde(column, (0.25, 0.25), inclusive=(1, 1))
        # scipy leaves one degree of freedom out: sqrt(n - 1) of the winsorised spread over the share that is kept.
        kept = 41 - 2 * int(0.25 * 41)
        spread = np.std(np.asarray(stats.mstats.winsorize(column, (0.25, 0.25), inclusive=(1, 1))), ddof=1)
        half = stats.t.ppf(0.975, kept - 1) * spread * math.sqrt(40 / (kept * (kept - 1)))
        assert (ours.value, ours.high - ours.value) == pytest.approx((centre, half), rel=1e-9)
        assert error == pytest.approx(spread / (kept / 41 * math.sqrt(41)), rel=0.05)


def test_the_interquartile_mean_is_rliables():
    """Agarwal et al.: `scipy.stats.trim_mean(scores, proportiontocut=0.25)`, for every number of episodes."""
    for episodes in range(1, 40):
        sample = np.random.default_rng(episodes).exponential(size=(episodes, 1))
        assert interquartile_means(sample)[0].value == pytest.approx(stats.trim_mean(sample[:, 0], 0.25), rel=1e-12)


def test_the_studentised_bootstrap_of_a_large_normal_sample_is_students():
    sample = np.random.default_rng(9).normal(3.0, 2.0, (400, 1))
    (ours,) = studentised_means(sample, np.random.default_rng(0), resamples=40_000)
    theirs = stats.ttest_1samp(sample[:, 0], 0.0).confidence_interval()
    width = theirs.high - theirs.low
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=0.03 * width)


def test_the_studentised_bootstrap_leans_where_a_sample_leans():
    """Of a skewed sample the upper end is farther away; of equal values, and where one differs, nothing is made up."""
    sample = np.random.default_rng(1).lognormal(size=(30, 1))
    (ours,) = studentised_means(sample, np.random.default_rng(0))
    assert ours.high - ours.value > 1.2 * (ours.value - ours.low)
    equal, one = studentised_means(np.c_[np.full(64, 0.1), np.r_[np.zeros(63), 1.0]], np.random.default_rng(0))
    assert (equal.low, equal.high) == pytest.approx((0.1, 0.1), rel=1e-9)
    assert one.low < 0.0 < one.high


def test_a_difference_of_paired_rates_as_printed():
    """Newcombe (1998), Table II, method 10: 36, 12, 2, 0 of 50 gives 0.0569 to 0.3404."""
    ours = np.r_[np.ones(36), np.ones(12), np.zeros(2)].astype(bool)
    theirs = np.r_[np.ones(36), np.zeros(12), np.ones(2)].astype(bool)
    found = paired_rates(ours, theirs)
    assert found.value == pytest.approx(0.2)
    assert (found.low, found.high) == pytest.approx((0.0569, 0.3404), abs=5e-5)
    turned = paired_rates(theirs, ours)
    assert (turned.low, turned.high) == pytest.approx((-found.high, -found.low), abs=1e-12)
    same = paired_rates(ours, ours)
    assert same.value == 0.0 and same.low == pytest.approx(-same.high)


def test_the_performance_profile_is_the_share_above():
    scores = np.random.default_rng(2).normal(size=(5, 7))
    thresholds = np.r_[-9.0, scores.ravel()[:4], 0.0, 9.0]
    expected = [(scores > threshold).mean() for threshold in thresholds]
    assert performance_profile(scores, thresholds) == pytest.approx(expected)


@pytest.mark.parametrize("seeds", [(5, 8), (3, 1), (10, 10)])
def test_the_probability_of_improvement_is_mann_and_whitneys(seeds):
    """rliable's definition: U over the product of the numbers of runs, averaged over scenarios."""
    generator = np.random.default_rng(3)
    ours, theirs = generator.integers(0, 9, (seeds[0], 6)) + 1.0, generator.integers(0, 9, (seeds[1], 6)) * 1.0
    found = probability_of_improvement(ours, theirs, np.random.default_rng(0))
    pairs = seeds[0] * seeds[1]
    u = [stats.mannwhitneyu(ours[:, k], theirs[:, k]).statistic / pairs for k in range(6)]
    assert found.value == pytest.approx(np.mean(u), abs=1e-12)
    assert 0.0 <= found.low < found.value < found.high <= 1.0


def test_the_stratified_bootstrap_draws_runs_for_each_scenario():
    """Written out once more with plain indices, as rliable's `StratifiedBootstrap` does."""
    generator = np.random.default_rng(4)
    ours, theirs = generator.normal(0.4, 1.0, (8, 5)), generator.normal(size=(6, 5))
    found = probability_of_improvement(ours, theirs, np.random.default_rng(0), resamples=20_000)
    drawn = []
    for _ in range(4000):
        mine = np.stack([ours[generator.integers(0, 8, 8), k] for k in range(5)], axis=1)
        other = np.stack([theirs[generator.integers(0, 6, 6), k] for k in range(5)], axis=1)
        drawn.append((mine[:, None] > other[None]).mean())
    assert (found.low, found.high) == pytest.approx(np.quantile(drawn, [0.025, 0.975]), abs=0.012)


def test_runs_that_always_win_leave_a_doubt():
    found = probability_of_improvement(np.ones((5, 10)), np.zeros((1, 10)), np.random.default_rng(0))
    assert found.value == found.high == 1.0 and 0.8 < found.low < 0.99


def test_a_single_run_of_both_has_no_interval():
    found = probability_of_improvement(np.ones((1, 4)), np.zeros((1, 4)), np.random.default_rng(0))
    assert found.value == 1.0 and math.isnan(found.low)
    with pytest.raises(ValueError, match="as many scenarios of both"):
        probability_of_improvement(np.ones((2, 4)), np.zeros((2, 3)), np.random.default_rng(0))
