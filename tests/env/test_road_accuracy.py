"""How near a road is to the line that its points were taken from, everywhere and not at the points alone."""

import math
import warnings

import numpy as np
import pytest

from lanekeep_env.roads import Road, SineRoad
from lanekeep_env.roads.fit import fit_centre_line

R, L = 50.0, 100.0
LINES = {
    "stadium": Road(
        "stadium",
        [L, math.pi * R] * 2,
        [0, 1 / R, 0, 1 / R],
        [0, 1 / R, 0, 1 / R],
        closed=True,
        origin=(7.0, -3.0, 0.4),
    ),
    "eight": Road("eight", [2 * math.pi * R] * 2, [1 / R, -1 / R], [1 / R, -1 / R], closed=True),
    "clothoid": Road("clothoid", [100.0, 200.0, 150.0, 80.0], [0, 0, 0.01, -0.005], [0, 0.01, 0.01, -0.005]),
    "sine": SineRoad(0.0109, 400.0, 1600.0).build()[0],
}
#: Where the curvature jumps, m.
JUMPS = {"stadium": [0, L, L + math.pi * R, 2 * L + math.pi * R], "eight": [0, 2 * math.pi * R], "clothoid": [450.0]}


def sampled(road, spacing, uneven=0.0, seed=0):
    """Points on a road, each moved along it by up to ``uneven`` of the spacing."""
    count = round(road.length / spacing)
    s = np.linspace(0.0, road.length, count + 1)
    s[1:-1] += np.random.default_rng(seed).uniform(-uneven, uneven, count - 1) * road.length / count
    return road.position(s[:-1] if road.closed else s)


def simplified(points, tolerance):
    """Ramer, Douglas, Peucker: as few of the points as leave none farther than the tolerance from the polyline."""
    keep, stack = {0, len(points) - 1}, [(0, len(points) - 1)]
    while stack:
        a, b = stack.pop()
        if b < a + 2:
            continue
        chord, offset = points[b] - points[a], points[a + 1 : b] - points[a]
        reach = np.hypot(*chord)
        off = np.hypot(*offset.T) if reach < 1e-9 else np.abs(chord[0] * offset[:, 1] - chord[1] * offset[:, 0]) / reach
        worst = a + 1 + int(np.argmax(off))
        if off[worst - a - 1] > tolerance:
            keep.add(worst)
            stack += [(a, worst), (worst, b)]
    return points[sorted(keep)]


def errors(truth, road, away):
    """Largest distance (m), and largest and RMS curvature error (1/m) farther than ``away`` m from a jump."""
    at = np.linspace(0.0, truth.length, 5000, endpoint=False)
    s = at * road.length / truth.length
    for _ in range(6):  # to the nearest place on the road
        heading, offset = road.heading(s), truth.position(at) - road.position(s)
        s = s + np.cos(heading) * offset[:, 0] + np.sin(heading) * offset[:, 1]
        s = s if road.closed else np.clip(s, 0.0, road.length)
    off = np.hypot(*(truth.position(at) - road.position(s)).T).max()
    bend = np.abs(road.curvature(s) - truth.curvature(at))
    far = np.ones(len(at), dtype=bool)
    for jump in JUMPS.get(truth.name, ()):
        apart = np.abs(at - jump)
        far &= (np.minimum(apart, truth.length - apart) if truth.closed else apart) > away
    return off, bend[far].max(), math.sqrt((bend**2).mean())


@pytest.mark.parametrize("spacing", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("uneven", [0.0, 0.4])
@pytest.mark.parametrize("name", LINES)
def test_exact_points_give_the_line_everywhere(name, uneven, spacing):
    truth = LINES[name]
    road = fit_centre_line(name, sampled(truth, spacing, uneven), truth.closed)
    off, bend, _ = errors(truth, road, 2.0 * spacing)
    assert off < 1e-3 and bend < 1e-4 and road.fit_error < 1e-6
    for jump in JUMPS.get(name, ()):  # in its place within a spacing
        here = road.curvature(np.array([jump - spacing, jump + spacing]) % truth.length)
        there = truth.curvature(np.array([jump - spacing, jump + spacing]) % truth.length)
        np.testing.assert_allclose(here, there, atol=1e-4)


@pytest.mark.parametrize("name", LINES)
def test_simplified_lines_do_not_bend_their_straights(name):
    truth = LINES[name]
    dense = sampled(truth, 0.5)
    points = simplified(np.vstack([dense, dense[:1]]) if truth.closed else dense, 0.05)
    assert len(points) < len(dense) / 3 or name == "eight"
    road = fit_centre_line(name, points[:-1] if truth.closed else points, truth.closed)
    off, _, _ = errors(truth, road, 0.0)
    assert off < 0.1  # the polyline itself is off by 0.05 m
    if name == "stadium":
        assert np.abs(road.curvature(np.linspace(10.0, L - 10.0, 50))).max() < 3e-4  # of 0.02 in the arcs


#: Scatter (m), and the largest distance (m) and RMS curvature error (1/m) with smoothing by that. Lines whose curvature
#: jumps keep a bias: the jump is drawn out over the length that the road's `assumed` tells.
NOISE = {0.02: (0.15, 0.003), 0.1: (0.6, 0.0035), 1.0: (7.0, 0.006)}


@pytest.mark.parametrize("scatter", NOISE)
@pytest.mark.parametrize("name", LINES)
def test_noisy_lines_are_told_or_refused_and_smoothed_on_request(name, scatter):
    truth = LINES[name]
    points = sampled(truth, 5.0)
    points = points + scatter * np.random.default_rng(1).normal(size=points.shape)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            fit_centre_line(name, points, truth.closed)
        except ValueError as error:
            assert "smoothing=" in str(error) and "scatter by about" in str(error)
        else:
            assert scatter < 0.1 and any("scatter by" in str(one.message) for one in caught)
    road = fit_centre_line(name, points, truth.closed, smoothing=scatter)
    off, _, bend = errors(truth, road, 0.0)
    assert off < NOISE[scatter][0] and bend < NOISE[scatter][1]
    assert "flattened" in road.assumed[-1]


def test_segments_follow_spacing_and_radius():
    """A model car's circuit: bends of half a metre, points every 5 cm."""
    track = Road("small", [3.0, math.pi / 2] * 2, [0, 2, 0, 2], [0, 2, 0, 2], closed=True)
    for scatter in (0.0, 5e-4):
        points = sampled(track, 0.05)
        points = points + scatter * np.random.default_rng(0).normal(size=points.shape)
        road = fit_centre_line("small", points, True, smoothing=scatter)
        assert road.length == pytest.approx(track.length, rel=3e-3)
        assert road.lengths.max() < 0.3 and road.peak_curvature == pytest.approx(2.0, rel=0.2)


def test_repeated_points_are_left_out():
    truth = LINES["stadium"]
    points = sampled(truth, 4.0)
    doubled = np.vstack([np.repeat(points, 2, axis=0), points[:1]])
    road = fit_centre_line("doubled", doubled, True)
    np.testing.assert_array_equal(road.lengths, fit_centre_line("once", points, True).lengths)
    assert "repeated points left out" in road.assumed[0]
