"""Scans as points: lost beams, the sliding median and what it erases, coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from scan_oracle import FARTHEST, VIEW, cast, wall
from scipy.ndimage import median_filter

from lanekeep_baselines import scan_points as scan

GAP = 0.006


def test_nothing_shown_is_the_largest_range():
    raw = [[0.0, np.nan, 3.0, 13.0, np.inf]]
    np.testing.assert_array_equal(scan.filled(raw, FARTHEST), [[12.0, 12.0, 3.0, 12.0, 12.0]])


def test_points_lie_on_the_wall():
    ranges = cast(wall(1.3, np.deg2rad(60.0)))
    ahead, left = np.moveaxis(scan.points(ranges, -0.5 * VIEW, scan.beam_step(141, VIEW)), 2, 0)
    np.testing.assert_allclose(np.sin(np.deg2rad(60.0)) * (ahead - 1.3), np.cos(np.deg2rad(60.0)) * left, atol=1e-9)


def test_the_median_is_scipy_s():
    raw = np.random.default_rng(1).uniform(0.5, 5.0, (7, 141))
    for width in (1, 5, 41):
        np.testing.assert_array_equal(scan.median(raw, width), median_filter(raw, (1, width), mode="nearest"))


@pytest.mark.parametrize("beams, smallest", [(512, 0.048), (141, 0.176), (64, 0.41)])
def test_the_report_s_median_erases_flat_obstacles_up_to_twenty_beams(beams, smallest):
    """Flat, across and 1 m ahead: erased if 20 beams see it, kept if 21 do, wherever it is between the beams."""
    step = scan.beam_step(beams, VIEW)
    one = np.tan(np.clip(step * 20.0, 0.0, 1.0))
    assert smallest == pytest.approx(one, rel=0.02 if beams > 64 else 0.1)
    middle = (beams // 2 - (beams - 1) / 2) * step  # angle of a beam near the axis
    for seen in (20, 21):
        first, last = middle - (seen // 2) * step, middle + ((seen - 1) // 2) * step
        ends = np.tan([first - 0.4 * step, last + 0.4 * step])
        filtered = scan.median(cast([(1.0, ends[0]), (1.0, ends[1])], wall(3.0, np.pi / 2), beams=beams))
        assert (filtered.min() < 1.5) == (seen == 21)
    # Geometry's bounds: what 20 beams can see at most is erased, what 21 see at least may stay.
    assert np.diff(ends)[0] > 0.95 * smallest


def test_the_rim_is_kept_where_a_window_cut_off_would_erase_it():
    raw = np.full((1, 141), 4.0)
    raw[0, :10] = 1.0
    assert (scan.median(raw)[0, 0] == 1.0) and (scan.median(raw[:, ::-1])[0, -1] == 1.0)
    cut = [np.median(raw[0, max(0, i - 20) : i + 21]) for i in range(141)]
    assert min(cut) == 4.0


@pytest.mark.parametrize("angle", [90.0, 60.0, -45.0])
def test_bridged_beams_lie_on_the_wall(angle):
    true = cast(wall(1.2, np.deg2rad(angle)))
    raw = true.copy()
    raw[0, 6::7], raw[0, 40:43], raw[0, :3], raw[0, -3:] = 0.0, np.nan, 0.0, 0.0
    bridged = scan.bridged(raw, FARTHEST, 3)
    np.testing.assert_allclose(bridged[0, 3:-3], true[0, 3:-3], rtol=3e-4)
    np.testing.assert_array_equal(bridged[0, :3], true[0, 3])
    np.testing.assert_array_equal(bridged[0, -3:], true[0, -4])
    raw[0, 60:64] = 0.0  # a longer gap shows nothing
    np.testing.assert_array_equal(scan.bridged(raw, FARTHEST, 3)[0, 60:64], FARTHEST)
    np.testing.assert_array_equal(scan.bridged(np.zeros((2, 9)), FARTHEST, 20), np.full((2, 9), FARTHEST))


def test_rows_are_independent_and_never_nan():
    random = np.random.default_rng(2)
    raw = np.where(random.random((50, 64)) < 0.3, 0.0, random.uniform(0.5, 12.0, (50, 64)))
    raw[::7, 3] = np.nan
    together = scan.median(scan.bridged(raw, FARTHEST, 4), 5)
    assert np.isfinite(together).all()
    for row in range(50):
        alone = scan.median(scan.bridged(raw[row : row + 1], FARTHEST, 4), 5)
        np.testing.assert_array_equal(alone, together[row : row + 1])
