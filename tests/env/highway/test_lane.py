"""Our roads as lanes of highway-env: clothoids exactly, in its signs."""

import json

import numpy as np
import pytest
from highway_env.road.lane import CircularLane, lane_from_config
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import fresnel

from lanekeep_env.adapters.highway import RoadLane
from lanekeep_env.roads import Road, road_from

ROADS = ("random", "roadworks", "straight", "turn-off", {"kind": "circle", "radius": -40.0}, "sine")


def test_a_clothoid_is_the_fresnel_integral_to_the_other_side():
    """Curvature s/A² from a straight: x = A sqrt(pi) C(t), y = A sqrt(pi) S(t), t = s/(A sqrt(pi)); left: -y."""
    length, end = 80.0, 1 / 30.0
    scale = np.sqrt(length / end * np.pi)
    lane = RoadLane(Road("clothoid", [length], [0.0], [end]))
    for s in np.linspace(0.0, length, 33):
        sine, cosine = fresnel(s / scale)
        assert lane.position(s, 0.0) == pytest.approx([scale * cosine, -scale * sine], abs=1e-12)
        assert lane.heading_at(s) == pytest.approx(-0.5 * end / length * s * s, abs=1e-14)


def test_a_circle_is_their_own():
    ours = RoadLane(Road("circle", [2 * np.pi * 40.0], [1 / 40.0], [1 / 40.0], closed=True, origin=(3.0, 4.0, 0.0)))
    theirs = CircularLane([3.0, -44.0], 40.0, np.pi / 2, -3 * np.pi / 2, clockwise=False)
    for s, lateral in ((0.0, 0.0), (11.0, 1.5), (120.0, -1.5)):
        assert ours.position(s, lateral) == pytest.approx(theirs.position(s, lateral), abs=1e-9)
        wanted = theirs.heading_at(s)
        assert np.exp(1j * ours.heading_at(s)) == pytest.approx(np.exp(1j * wanted), abs=1e-9)
        assert ours.local_coordinates(theirs.position(s, lateral)) == pytest.approx((s, lateral), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(which=st.integers(0, len(ROADS) - 1), share=st.floats(0.0, 1.0), lateral=st.floats(-1.7, 1.7))
def test_a_place_on_a_lane_comes_back(which, share, lateral):
    lane = _LANES[which]
    # The start and the end of a closed road are one place.
    s = share * (lane.length - 1e-6)
    assert lane.local_coordinates(lane.position(s, lateral)) == pytest.approx((s, lateral), abs=1e-8)


_LANES = [RoadLane(road_from(road).build()[0], offset=-0.8, width=3.5) for road in ROADS]


def test_an_open_road_goes_on_beyond_its_end_with_its_last_curvature():
    lane = RoadLane(Road("bend", [20.0, 10.0], [0.0, 0.02], [0.0, 0.02]))
    for s in (30.5, 37.0):
        assert lane.local_coordinates(lane.position(s, 1.0)) == pytest.approx((s, 1.0), abs=1e-9)
    assert lane.on_lane(lane.position(34.0, 1.0)) and not lane.on_lane(lane.position(36.0, 1.0))


def test_a_lane_through_json_is_the_same_to_the_last_bit():
    lane = _LANES[0]
    again = lane_from_config(json.loads(json.dumps(lane.to_config())))
    assert type(again) is RoadLane and again.width == lane.width and again.line_types == lane.line_types
    for s in np.linspace(0.0, lane.length, 50):
        assert (again.position(s, 0.7) == lane.position(s, 0.7)).all()


def test_a_lane_that_would_fold_over_itself_is_refused():
    with pytest.raises(ValueError, match="has a radius of 2 m"):
        RoadLane(Road("tight", [10.0], [0.5], [0.5]), width=4.5)
