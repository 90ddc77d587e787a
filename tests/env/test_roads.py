"""Roads against Fresnel integrals, circles, quadrature and invariants under random input."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.special import fresnel

from lanekeep_env.roads import (
    ROADS,
    CircleRoad,
    ConstantSpeed,
    LimitedSpeed,
    RandomRoads,
    Road,
    SineRoad,
    SlalomRoad,
    StraightRoad,
    YinRoad,
    build_roads,
    road_from,
    speed_from,
)


def random_road(seed, closed=False):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 12))
    start, end = rng.uniform(-0.05, 0.05, (2, n)) * (rng.random((2, n)) < 0.8)
    return Road("random", rng.uniform(0.5, 120.0, n), start, end, closed=closed, origin=(3.0, -2.0, 0.7))


def test_clothoid_is_the_fresnel_integral():
    length, peak = 120.0, 0.02
    road = Road("clothoid", [length], [0.0], [peak])
    s = np.linspace(0.0, length, 50)
    scale = math.sqrt(math.pi * length / peak)
    sine, cosine = fresnel(s / scale)
    np.testing.assert_allclose(road.position(s), scale * np.column_stack([cosine, sine]), atol=1e-10)
    np.testing.assert_allclose(road.heading(s), peak * s**2 / (2 * length), atol=1e-14)


@pytest.mark.parametrize("radius", [20.0, -150.0])
def test_circle_is_a_circle(radius):
    (road,) = CircleRoad(radius).build()
    s = np.linspace(0.0, 3 * road.length, 100)
    centre = np.array([0.0, radius])
    np.testing.assert_allclose(np.hypot(*(road.position(s) - centre).T), abs(radius), atol=1e-9)
    np.testing.assert_allclose(np.hypot(*(road.position(s, 1.5) - centre).T), abs(radius - 1.5), atol=1e-9)
    np.testing.assert_allclose(road.heading(s), s / radius, atol=1e-9)
    np.testing.assert_allclose(road.points[-1], road.points[0], atol=1e-10)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_geometry_is_the_integral_of_the_curvature(seed):
    road = random_road(seed)
    s = road.length * 0.77
    borders = [b for b in road.stations if b < s]
    heading = road.origin[2] + sum(
        quad(road.curvature, a, b, epsabs=1e-12)[0] for a, b in zip(borders, [*borders[1:], s], strict=True)
    )
    assert float(road.heading(s)) == pytest.approx(heading, abs=1e-6)
    step = 1e-5
    ahead, behind = road.position(s + step), road.position(s - step)
    course = math.atan2(*(ahead - behind)[::-1])
    assert math.remainder(course - float(road.heading(s)), 2 * math.pi) == pytest.approx(0.0, abs=1e-5)
    assert np.hypot(*(ahead - behind)) == pytest.approx(2 * step, rel=1e-4)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), piece=st.floats(0.3, 50.0))
def test_refining_changes_nothing(seed, piece):
    road = random_road(seed)
    fine = road.refined(piece)
    assert fine.lengths.max() <= piece * (1 + 1e-9)
    s = np.linspace(0.0, 1.2 * road.length, 200)
    np.testing.assert_allclose(fine.position(s, 0.5), road.position(s, 0.5), atol=1e-9)
    inside = np.abs(s[:, None] - road.stations).min(axis=1) > 1e-6
    np.testing.assert_allclose(fine.curvature(s)[inside], road.curvature(s)[inside], atol=1e-12)


def any_limits(test):
    """Try a test on drawn roads with drawn limits of a speed profile, m/s²."""
    accelerations = {"lateral": st.floats(0.5, 9.0), "gain": st.floats(0.2, 5.0), "brake": st.floats(0.2, 8.0)}
    drawn = given(seed=st.integers(0, 10**6), closed=st.booleans(), **accelerations)
    return settings(max_examples=60, deadline=None)(drawn(test))


@any_limits
def test_limited_speed_keeps_every_limit_everywhere(seed, closed, lateral, gain, brake):
    profile = LimitedSpeed(lateral, 40.0, acceleration=gain, deceleration=brake)
    road, speed = profile.along(random_road(seed, closed))
    squared = speed**2
    acceleration = np.diff(squared) / (2 * road.lengths)
    assert acceleration.max() <= gain * (1 + 1e-9) + 1e-9 and acceleration.min() >= -brake * (1 + 1e-9) - 1e-9
    assert speed.max() <= 40.0 + 1e-9
    if closed:
        assert speed[0] == pytest.approx(speed[-1], rel=1e-9)
    share = np.linspace(0.0, 1.0, 11)[:, None]
    here = squared[:-1] + share * np.diff(squared)
    curvature = road.curvature_start + share * (road.curvature_end - road.curvature_start)
    assert (here * np.abs(curvature)).max() <= lateral * (1 + 1e-9)


@any_limits
def test_a_profile_within_the_friction_ellipse_keeps_within_it_everywhere(seed, closed, lateral, gain, brake):
    profile = LimitedSpeed(lateral, 40.0, acceleration=gain, deceleration=brake, friction_ellipse=True)
    road, speed = profile.along(random_road(seed, closed))
    squared = speed**2
    along = np.diff(squared) / (2 * road.lengths)
    share = np.linspace(0.0, 1.0, 11)[:, None]
    here = squared[:-1] + share * np.diff(squared)
    across = here * (road.curvature_start + share * (road.curvature_end - road.curvature_start))
    used = (along / np.where(along > 0.0, gain, brake)) ** 2 + (across / lateral) ** 2
    assert used.max() <= 1.0 + 1e-6
    if closed:
        assert speed[0] == pytest.approx(speed[-1], rel=1e-9)
    _, plain = LimitedSpeed(lateral, 40.0, acceleration=gain, deceleration=brake).along(random_road(seed, closed))
    assert (speed <= plain * (1.0 + 1e-9)).all()
    assert profile.lateral_limit == max(lateral, gain, brake)  # what friction must give


def test_out_of_a_bend_the_ellipse_is_used_up():
    """In a clothoid that opens, v v' = gain sqrt(1 - (v² kappa / limit)²): the profile's segments converge to it."""
    road = Road("clothoid", [100.0, 100.0, 400.0], [0.02, 0.02, 0.0], [0.02, 0.0, 0.0])
    fine, speed = LimitedSpeed(4.0, 60.0, acceleration=2.0, friction_ellipse=True).along(road.refined(0.5))

    def rate(s, squared):
        across = squared * float(road.curvature(s)) / 4.0
        return 4.0 * np.sqrt(np.maximum(1.0 - across**2, 0.0))

    exact = solve_ivp(rate, (100.0, 400.0), [200.0], t_eval=[150.0, 200.0, 300.0], rtol=1e-9, max_step=0.5).y[0]
    found = np.interp([150.0, 200.0, 300.0], fine.stations, speed**2)
    np.testing.assert_allclose(found, exact, rtol=0.01)


def test_speed_is_as_fast_as_the_limits_allow():
    """Braking from a straight into an arc follows v² = v_arc² + 2 a s; in the arc it is sqrt(a_lat R)."""
    road = Road("bend", [400.0, 200.0], [0.0, 0.01], [0.0, 0.01])
    profile = LimitedSpeed(4.0, 30.0, deceleration=2.0)
    fine, speed = profile.along(road)
    at = fine.stations
    expected = np.where(at >= 400.0 - 1e-9, 20.0, np.minimum(30.0, np.sqrt(400.0 + 4.0 * np.maximum(400.0 - at, 0.0))))
    np.testing.assert_allclose(speed, expected, atol=1e-9)


def test_yins_road_is_his_scenario():
    ((road, speed),) = build_roads(YinRoad(), LimitedSpeed())
    s = np.linspace(0, road.length, 20001)
    curvature = road.curvature(s)
    assert np.abs(curvature).max() == pytest.approx(0.0109, abs=5e-6)
    assert (curvature > 0.005).any() and (curvature < -0.005).any()
    assert np.abs(np.diff(curvature)).max() < 1e-4  # continuous
    assert speed.min() == pytest.approx(68.3 / 3.6, abs=0.05) and speed.max() == pytest.approx(50.0)
    ((_, floored),) = build_roads(YinRoad(), LimitedSpeed(lateral_acceleration=2.0))
    assert floored.min() == pytest.approx(68.0 / 3.6)
    ((_, free),) = build_roads(SineRoad(), LimitedSpeed(lateral_acceleration=2.0))
    assert free.min() < 60.0 / 3.6


@pytest.mark.parametrize("wavelength", [100.0, 400.0, 3200.0])
def test_sine_road_is_fitted_to_a_millimetre(wavelength):
    peak = 0.0109
    (road,) = SineRoad(peak, wavelength, length=max(2000.0, wavelength)).build()
    n = wavelength / (2 * math.pi)
    s = np.linspace(0.0, road.length, 400_001)
    heading = peak * n * (1 - np.cos(s / n))
    step = s[1]
    x = np.concatenate([[0], np.cumsum(0.5 * step * (np.cos(heading[1:]) + np.cos(heading[:-1])))])
    y = np.concatenate([[0], np.cumsum(0.5 * step * (np.sin(heading[1:]) + np.sin(heading[:-1])))])
    got = road.position(s[::500])
    assert np.hypot(got[:, 0] - x[::500], got[:, 1] - y[::500]).max() < 1e-3


def test_slalom_is_a_triangle_wave():
    (road,) = SlalomRoad(0.02, 200.0).build()
    np.testing.assert_allclose(
        road.curvature([0.0, 25.0, 50.0, 100.0, 150.0, 200.0, 250.0]), [0, 0.01, 0.02, 0, -0.02, 0, 0.02], atol=1e-12
    )


def test_random_roads_are_reproducible_and_as_described():
    first, again, other = RandomRoads(20).build(), RandomRoads(20).build(), RandomRoads(20, seed=1).build()
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.lengths, b.lengths)
        np.testing.assert_array_equal(a.curvature_end, b.curvature_end)
    assert not np.array_equal(first[0].curvature_start[:10], other[0].curvature_start[:10])
    lefts = rights = 0
    for road in first:
        assert road.length >= 6000.0 and road.peak_curvature <= 0.0109
        np.testing.assert_array_equal(road.curvature_end[:-1], road.curvature_start[1:])  # no jumps
        arcs = road.curvature_start[road.curvature_start == road.curvature_end]
        lefts, rights = lefts + (arcs > 0).sum(), rights + (arcs < 0).sum()
        # lateral jerk in the clothoids at the speed that the curve allows
        changing = road.curvature_start != road.curvature_end
        tightest = np.maximum(np.abs(road.curvature_start), np.abs(road.curvature_end))[changing]
        speed = np.minimum(50.0, np.sqrt(0.4 * 9.81 / tightest))
        np.testing.assert_allclose(tightest / road.lengths[changing] * speed**3, 1.5, rtol=1e-9)
    assert 0.8 < lefts / rights < 1.25


@pytest.mark.parametrize("kind", [kind for kind in ROADS if kind not in ("file", "points", "clothoids")])
def test_records_round_trip(kind):
    record = road_from(kind)
    assert road_from(record.to_dict()) == record
    assert all(isinstance(road, Road) for road in record.build())


def test_wrong_roads_and_speeds_are_named():
    for value, word in (
        ("sinus", "sine"),
        ({"kind": "circle", "radus": 3.0}, "radius"),
        ({"radius": 3.0}, "kind"),
        ({"kind": "circle", "radius": 0.0}, "radius"),
        ({"kind": "random", "peak_curvature": 0.5}, "peak_curvature"),
        ({"kind": "random", "count": 0}, "count"),
        ({"kind": "file"}, "path"),
        (17, "17"),
    ):
        with pytest.raises(ValueError, match=word):
            road_from(value)
    for value, word in (({"maximun": 3.0}, "maximum"), ("fast", "fast"), ({"acceleration": -1}, "acceleration")):
        with pytest.raises(ValueError, match=word):
            speed_from(value)
    with pytest.raises(ValueError, match=r"radius of 1 m at s = 0\.0 m"):
        CircleRoad(1.0).build()[0].check_lane(1.75)
    assert speed_from(13) == ConstantSpeed(13.0)
    assert StraightRoad(50.0).build()[0].length == 50.0
