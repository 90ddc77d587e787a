"""Roads of works yards: what their records promise, and curves that missing edges leave alone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lanekeep_env.roads import Road, TurnOffRoads, YardRoads, road_from


def random_road(seed, closed=False):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 12))
    start, end = rng.uniform(-0.2, 0.2, (2, n)) * (rng.random((2, n)) < 0.8)
    return Road("random", rng.uniform(0.5, 40.0, n), start, end, closed=closed, origin=(3.0, -2.0, 0.7))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), closed=st.booleans(), count=st.integers(0, 6))
def test_hiding_the_edge_leaves_the_curve_as_it_is(seed, closed, count):
    road, rng = random_road(seed, closed), np.random.default_rng([seed, 1])
    begin = rng.uniform(-5.0, 1.05 * road.length, count)
    begin[: count // 2] = rng.choice(road.stations, count // 2)  # some at borders, or nearly
    begin[:1] += rng.choice([0.0, 1e-9, -3e-7, 5e-6], 1)[: len(begin)]
    stretches = np.column_stack([begin, begin + rng.uniform(0.0, 12.0, count)])
    hidden = road.without_marking(stretches)
    assert abs(hidden.length - road.length) <= 4 * np.spacing(road.length) and (hidden.lengths > 0).all()
    assert set(road.stations) <= {float(road.stations[np.abs(road.stations - s).argmin()]) for s in hidden.stations}
    s = np.linspace(0.0, (2.0 if closed else 1.1) * road.length, 501)[:-1]
    np.testing.assert_allclose(hidden.position(s, 0.7), road.position(s, 0.7), atol=1e-10)
    np.testing.assert_allclose(hidden.heading(s), road.heading(s), atol=1e-12)
    here = s % road.length if closed else s
    clear = np.abs(here[:, None] - road.stations).min(axis=1) > 1e-9
    np.testing.assert_allclose(hidden.curvature(s)[clear], road.curvature(s)[clear], atol=1e-13)
    bounds = stretches.clip(0.0, road.length)
    away = np.abs(here[:, None] - bounds.ravel()).min(axis=1, initial=np.inf) > 1e-5
    inside = ((here[:, None] > bounds[:, 0]) & (here[:, None] < bounds[:, 1])).any(axis=1)
    np.testing.assert_array_equal(hidden.is_marked(s)[away], ~inside[away])


def test_hiding_twice_hides_both():
    road = Road("straight", [100.0], [0.0], [0.0]).without_marking([[10.0, 20.0]]).without_marking([[15.0, 30.0]])
    s = np.array([9.9, 10.1, 19.0, 21.0, 29.9, 30.1, 120.0])
    np.testing.assert_array_equal(road.is_marked(s), [True, False, False, False, False, True, True])
    fine = road.refined(0.7)
    np.testing.assert_array_equal(fine.is_marked(s), road.is_marked(s))
    assert Road("straight", [100.0], [0.0], [0.0]).is_marked(3.0)


def unmarked(road):
    """Stretches without an edge, (k, 2), m."""
    if road.marked is None:
        return np.zeros((0, 2))
    step = np.diff(np.concatenate([[True], road.marked, [True]]).astype(int))
    return np.column_stack([road.stations[np.flatnonzero(step < 0)], road.stations[np.flatnonzero(step > 0)]])


def bends(road):
    """(turn in rad, peak curvature, whether with clothoids) of each whole bend."""
    found, bend = [], []
    for length, start, end in zip(road.lengths, road.curvature_start, road.curvature_end, strict=True):
        if start == end == 0.0:
            if bend:
                found.append(bend)
            bend = []
        else:
            bend.append((0.5 * (start + end) * length, max(start, end, key=abs), start != end))
    return [(sum(b[0] for b in bend), max((b[1] for b in bend), key=abs), any(b[2] for b in bend)) for bend in found]


@pytest.mark.parametrize("seed", [0, 5])
def test_yards_have_the_bends_and_straights_they_promise(seed):
    record = YardRoads(count=60, smallest_radius=5.0, largest_radius=80.0, gap_spacing=None, seed=seed)
    roads = record.build()
    assert len(roads) == 60 and len({road.name for road in roads}) == 60
    all_bends = [bend for road in roads for bend in bends(road)]
    turn, peak, smooth = (np.array(column) for column in zip(*all_bends, strict=True))
    assert np.abs(turn).min() >= 0.3 - 1e-12 and np.abs(turn).max() <= 1.6 + 1e-12
    radius = 1 / np.abs(peak)
    assert radius.min() >= 5.0 - 1e-9 and radius.max() <= 80.0 + 1e-9 and radius.min() < 5.5 and radius.max() > 70.0
    share = np.log(radius / 5.0) / np.log(16.0)  # log-uniform; the end of a road favours short bends a little
    assert share.mean() == pytest.approx(0.5, abs=0.06) and share.std() == pytest.approx(1 / math.sqrt(12), rel=0.1)
    assert (np.sign(turn) == np.sign(peak)).all() and 0.4 < (turn > 0).mean() < 0.6 and 0.4 < smooth.mean() < 0.6
    for road in roads:
        assert 400.0 <= road.length < 400.0 + 80.0 * 1.6 / 0.75 and road.marked is None
        straight = road.lengths[(road.curvature_start == 0.0) & (road.curvature_end == 0.0)]
        assert straight.min() >= 5.0 and straight.max() <= 40.0


def test_gaps_have_their_length_and_spacing_and_do_not_change_the_curve():
    without = YardRoads(count=30, gap_spacing=None).build()
    starts = []
    for length in (3.0, 8.0):
        found = []
        for road, plain in zip(YardRoads(count=30, gap_spacing=40.0, gap_length=length).build(), without, strict=True):
            gaps = unmarked(road)
            whole = gaps[gaps[:, 1] < road.length - 1e-6]
            np.testing.assert_allclose(np.diff(whole, axis=1), length, atol=1e-6)
            apart = np.diff(gaps[:, 0], prepend=0.0)
            assert apart.min() >= 20.0 - 1e-6 and apart.max() <= 60.0 + 1e-6
            assert road.length - gaps[-1, 0] <= 60.0
            s = np.linspace(0.0, road.length, 100)
            np.testing.assert_allclose(road.position(s), plain.position(s), atol=1e-9)
            found.append(gaps[:, 0])
        starts.append(np.concatenate(found))
    np.testing.assert_allclose(*starts, atol=2e-6)


def test_yards_come_from_their_seed():
    one, same, other = (YardRoads(count=3, seed=seed).build() for seed in (1, 1, 2))
    for a, b, c in zip(one, same, other, strict=True):
        np.testing.assert_array_equal(a.lengths, b.lengths)
        assert a.lengths.shape != c.lengths.shape or not np.allclose(a.lengths, c.lengths)


@pytest.mark.parametrize("lost", [0.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("side", ["right", "left", "both"])
def test_turning_off_is_a_quarter_circle_that_shows_no_edge(side, lost):
    roads = TurnOffRoads(side=side, lost=lost, smallest_radius=8.0, largest_radius=20.0).build()
    assert len(roads) == 64
    radii, signs = [], []
    for road in roads:
        assert road.curvature(0.0) == 0.0 and road.curvature(road.length - 1.0) == 0.0
        s = road.stations
        middle = road.curvature(0.5 * (s[1:] + s[:-1]))
        first = middle > 0  # the left curve comes first
        curve = int(np.flatnonzero(first)[0])
        straight_then = curve + 1
        while middle[straight_then] != 0.0:
            straight_then += 1
        turning = np.flatnonzero((middle != 0.0) & (np.arange(len(middle)) > straight_then))
        begin, end = s[turning[0]], s[turning[-1] + 1]
        radius = 1 / middle[turning[0]]
        assert abs(float(road.heading(end) - road.heading(begin))) == pytest.approx(math.pi / 2, abs=1e-12)
        assert end - begin == pytest.approx(math.pi / 2 * abs(radius), rel=1e-12)
        assert np.hypot(*(road.position(end) - road.position(begin))) == pytest.approx(math.sqrt(2) * abs(radius))
        assert road.length - end == pytest.approx(100.0)
        gaps = unmarked(road)
        if lost:
            np.testing.assert_allclose(gaps, [[begin, begin + lost * (end - begin)]], atol=1e-6)
        else:
            assert road.marked is None
        radii.append(abs(radius)), signs.append(math.copysign(1.0, radius))
    assert 8.0 <= min(radii) < 9.0 and 19.0 < max(radii) <= 20.0
    assert {"right": set(signs) == {-1.0}, "left": set(signs) == {1.0}, "both": 20 < signs.count(1.0) < 44}[side]


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"kind": "yard", "smallest_radius": 9.0, "largest_radius": 8.0}, ["smallest_radius=9.0", "together"]),
        ({"kind": "yard", "gap_spacing": 0.0}, ["road.gap_spacing=0.0", ">= 1", "None"]),
        ({"kind": "yard", "gap_length": -1.0}, ["road.gap_length", ">= 0.01"]),
        ({"kind": "yard", "length": 10.0}, ["road.length=10.0", ">= 50"]),
        ({"kind": "yard", "radius": 10.0}, ["radius", "smallest_radius"]),
        ({"kind": "turn-off", "side": "up"}, ["road.side='up'", "right, left, both"]),
        ({"kind": "turn-off", "lost": -0.1}, ["road.lost=-0.1", ">= 0"]),
        ({"kind": "turnoff"}, ["turnoff", "turn-off"]),
    ],
)
def test_wrong_yards_are_named(value, words):
    with pytest.raises(ValueError) as caught:
        road_from(value)
    assert "\n" not in str(caught.value) and all(word in str(caught.value) for word in words)
