"""The camera: edge distances against a second computation in world coordinates, and what its sensor makes of them."""

import math
from dataclasses import dataclass
from typing import ClassVar

import gymnasium as gym
import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

import lanekeep_env  # noqa: F401
from lanekeep_env import layout as at
from lanekeep_env.roads import Road, YardRoads
from lanekeep_env.roads.generators import RoadRecord

ID = "lanekeep/CameraLane-v0"
REACH = 3.0 + 3.5


@dataclass(frozen=True)
class WildRoads(RoadRecord):
    """Straights, arcs and clothoids of any curvature down to a radius of 4 m, with jumps, some without an edge."""

    kind: ClassVar[str] = "wild"
    seed: int = 0
    count: int = 40

    def build(self):
        rng = np.random.default_rng(self.seed)
        return tuple(self._one(k, rng) for k in range(self.count))

    def _one(self, k, rng):
        n = 60
        start, end = rng.uniform(-0.25, 0.25, (2, n)) * (rng.random((2, n)) < 0.7)
        arc = rng.random(n) < 0.4
        end[arc] = start[arc]
        road = Road(f"wild-{k}", rng.uniform(0.3, 12.0, n), start, end)
        return road.without_marking(np.add(rng.uniform(0, 300, (6, 1)), [0.0, 4.0])) if k % 2 else road


def truth(env):
    """The kernel's own distance, float64."""
    return np.concatenate([block[at.EDGE] for block in env.unwrapped._core.cars])[: env.num_envs]


def shown(cars, road, where, **keywords):
    """Edge distance (m, NaN where none is seen) of cars put at ``where``."""
    env = gym.make_vec(ID, cars, "vector_entry_point", road=road, **keywords)
    env.reset(seed=0, options=where)
    return truth(env), env.unwrapped.road_set()


def in_body_axes(road, s, d, theta, offset, along):
    """Points of the edge at arc length ``along``, seen from the rear axle in axes of the body: (..., 2)."""
    heading = float(road.heading(s)) + theta
    turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    return (road.position(along, np.full(np.shape(along), offset)) - road.position(s, d)) @ turn


def searched(road, s, d, theta, offset, reach=REACH):
    """(distance, arc length of the point, least forward share before it) by a fine search, or None if there is none."""
    fine = s + np.arange(0.0, 40.0, 0.01)
    points = in_body_axes(road, s, d, theta, offset, fine)
    forward = (1.0 - offset * road.curvature(fine)) * np.cos(road.heading(fine) - float(road.heading(s)) - theta)
    if points[0, 0] >= reach:
        return None
    beyond = np.flatnonzero(points[:, 0] >= reach)
    if len(beyond) == 0:
        return None
    k = int(beyond[0])
    ahead = brentq(
        lambda u: in_body_axes(road, s, d, theta, offset, np.array(u))[0] - reach, fine[k - 1], fine[k], xtol=1e-14
    )
    lateral = in_body_axes(road, s, d, theta, offset, np.array(ahead))[1]
    return math.copysign(1.0, offset) * lateral, ahead, forward[: k + 1].min()


@pytest.mark.parametrize("edge", ["right", "left"])
@pytest.mark.parametrize("record", [WildRoads(), YardRoads(count=40, smallest_radius=4.0)])
def test_the_distance_is_that_of_a_fine_search_in_world_coordinates(record, edge):
    cars, rng = 600, np.random.default_rng(5)
    where = {
        "road_index": rng.integers(0, 40, cars),
        "arc_length": rng.uniform(0.0, 250.0, cars),
        "lateral_error": rng.uniform(-1.6, 1.6, cars),
        "heading_error": rng.uniform(-1.2, 1.2, cars) * rng.random(cars),
    }
    got, roads = shown(cars, record, where, camera={"edge": edge, "field_of_view": 1.9})
    offset = 1.5 if edge == "left" else -1.5
    compared = hidden = 0
    for i in range(cars):
        s, d, theta = (float(where[key][i]) for key in ("arc_length", "lateral_error", "heading_error"))
        road = roads[int(where["road_index"][i])][0]
        found = searched(road, s, d, theta, offset)
        if found is None or found[2] < 0.0:
            assert np.isnan(got[i]), (i, got[i], found)  # it turns away before
            continue
        distance, ahead, forward = found
        if forward < 0.051:  # looked at across: the camera may or may not see it
            continue
        inside = abs(math.atan2(distance, 3.5)) <= 0.95
        marked = bool(road.is_marked(ahead))
        if inside and marked:
            assert got[i] == pytest.approx(distance, abs=1e-9), (i, found)
            compared += 1
        elif abs(ahead - road.stations).min() > 1e-6:
            assert np.isnan(got[i]), (i, found)
            hidden += 1
    assert compared > 0.5 * cars and hidden > 10


@pytest.mark.parametrize("edge", ["right", "left"])
def test_on_a_straight_it_is_the_offset_over_the_cosine(edge):
    cars, rng = 300, np.random.default_rng(0)
    d, theta = rng.uniform(-1.5, 1.5, cars), rng.uniform(-1.0, 1.0, cars)
    where = {"lateral_error": d, "heading_error": theta, "arc_length": np.full(cars, 20.0)}
    got, _ = shown(cars, "straight", where, camera={"edge": edge, "field_of_view": math.radians(170)})
    across = d + REACH * np.sin(theta)
    expected = (1.5 + (across if edge == "right" else -across)) / np.cos(theta)
    seen = ~np.isnan(got)
    np.testing.assert_allclose(got[seen], expected[seen], atol=1e-10)
    assert seen.all()


@pytest.mark.parametrize("edge", ["right", "left"])
@pytest.mark.parametrize("radius", [6.0, -6.0, 9.5, -40.0, 300.0])
def test_on_a_circle_it_is_the_chord_of_the_edge(radius, edge):
    cars, rng = 200, np.random.default_rng(1)
    d, theta = rng.uniform(-1.0, 1.0, cars), rng.uniform(-0.5, 0.5, cars)
    where = {"lateral_error": d, "heading_error": theta}
    offset = 1.5 if edge == "left" else -1.5
    got, _ = shown(
        cars,
        {"kind": "circle", "radius": radius},
        where,
        camera={"edge": edge, "field_of_view": math.radians(170)},
    )
    centre = (radius - d) * np.array([np.sin(theta), np.cos(theta)])
    missing = REACH - centre[0]
    inside = np.abs(missing) < 0.99 * abs(radius - offset)
    y = centre[1] - math.copysign(1.0, radius) * np.sqrt(np.where(inside, (radius - offset) ** 2 - missing**2, 1.0))
    expected = y if edge == "left" else -y
    np.testing.assert_allclose(got[inside], expected[inside], atol=1e-9)
    assert inside.any() and np.isnan(got[np.abs(missing) > abs(radius - offset)]).all()


def test_a_gentle_curve_moves_the_edge_by_the_sagitta():
    """(l + f)²/(2 R), further away where the road turns towards the edge."""
    for radius in (5000.0, -5000.0):
        (right,), _ = shown(1, {"kind": "circle", "radius": radius}, {"lateral_error": 0.0, "heading_error": 0.0})
        assert right - 1.5 == pytest.approx(-(REACH**2) / (2 * radius), rel=2e-3)


def test_it_is_seen_inside_the_field_of_view_only():
    """On a straight, moved sideways: seen where the angle at the front axle is at most half the field of view."""
    for degrees in (40.0, 60.0, 100.0):
        cars = 400
        d = np.linspace(-1.49, 8.0, cars)
        got, _ = shown(
            cars,
            "straight",
            {"lateral_error": d, "heading_error": np.zeros(cars), "arc_length": np.full(cars, 5.0)},
            camera={"field_of_view": math.radians(degrees)},
        )
        angle = np.arctan2(d + 1.5, 3.5)
        np.testing.assert_array_equal(~np.isnan(got), angle <= math.radians(degrees / 2))


def test_no_edge_is_seen_where_the_point_of_the_edge_has_no_marking():
    """Driving straight ahead the distance is lost while the look-ahead point, not the van, is in the gap."""
    cars = 401
    s = np.linspace(70.0, 110.0, cars)
    road = MarkedStraight()
    got, _ = shown(cars, road, {"arc_length": s, "lateral_error": np.zeros(cars), "heading_error": np.zeros(cars)})
    point = s + REACH
    clear = np.minimum(np.abs(point - 90.0), np.abs(point - 97.0)) > 1e-6
    np.testing.assert_array_equal(np.isnan(got)[clear], ((point > 90.0) & (point < 97.0))[clear])


@dataclass(frozen=True)
class MarkedStraight(RoadRecord):
    """300 m straight; its edge is missing from 90 to 97 m and beyond ``last``."""

    kind: ClassVar[str] = "marked-straight"
    last: float = 1000.0

    def build(self):
        road = Road("straight", [1000.0], [0.0], [0.0])
        return (road.without_marking([[90.0, 97.0], [self.last, 1000.0]]),)


def drive(steps=250, cars=1, sensor=None, start=60.0, speed=5.0, weave=0.1, **keywords):
    """Observation (steps + 1, cars, channels) and true distance (steps + 1, cars) on the straight with a gap."""
    env = gym.make_vec(
        ID,
        cars,
        "vector_entry_point",
        road=MarkedStraight(),
        speed=speed,
        departure="off",
        sensors={"edge_distance": sensor} if sensor else None,
        **keywords,
    )
    options = {"arc_length": start, "lateral_error": 0.0, "heading_error": 0.0}
    seen, _ = env.reset(seed=3, options=options)
    seen, true = [seen], [truth(env)]
    for k in range(steps):
        action = np.full((cars, 1), weave * math.cos(0.2 * k), np.float32)
        seen.append(env.step(action)[0])
        true.append(truth(env))
    return np.array(seen), np.array(true), [channel.name for channel in env.unwrapped.channels]


def held(values):
    """Each NaN replaced by the last number before it (1.5 m, the straight's distance, where there is none)."""
    values, last = values.copy(), np.full(values.shape[1], 1.5)
    for row in values:
        lost = np.isnan(row)
        row[lost] = last[lost]
        last = row.copy()
    return values


def test_the_last_valid_distance_is_held_and_told_to_be_old():
    seen, true, _ = drive()
    lost = np.isnan(true)
    assert lost.sum() == pytest.approx(7.0 / (5.0 * 0.04), abs=1.5) and not lost[0] and not lost[-1]
    np.testing.assert_array_equal(seen[..., 1], ~lost)
    np.testing.assert_allclose(seen[..., 0], held(true), atol=1e-6)
    assert np.ptp(seen[..., 0]) > 0.05


def test_until_an_edge_was_seen_the_distance_of_a_straight_is_shown():
    seen, true, _ = drive(start=84.5, steps=60, sensor={"noise": 0.1, "bias": 0.3})
    first = int(np.flatnonzero(~np.isnan(true[:, 0]))[0])
    assert 20 < first < 40
    np.testing.assert_array_equal(seen[:first, 0, 0], 1.5)
    np.testing.assert_array_equal(seen[:first, 0, 1], 0.0)
    assert seen[first, 0, 0] != 1.5 and seen[first, 0, 1] == 1.0
    wide, _, _ = drive(start=84.5, steps=1, lane_width=2.4)
    assert wide[0, 0, 0] == pytest.approx(1.2)


def test_latency_and_frame_period_shift_and_hold_distance_and_validity_alike():
    seen, true, names = drive(sensor={"delay": 0.12, "period": 0.08})
    assert names[-1] == "edge_distance_new"
    steps = np.arange(len(true))
    picture = np.maximum(steps // 2 * 2 - 3, 0)
    np.testing.assert_allclose(seen[..., 0], held(true[picture]), atol=1e-6)
    np.testing.assert_array_equal(seen[..., 1], ~np.isnan(true[picture]))
    np.testing.assert_array_equal(seen[:, 0, -1], steps % 2 == 0)


def test_no_channel_tells_of_new_samples_where_each_step_brings_one():
    _, _, names = drive(steps=1, sensor={"noise": 0.1, "delay": 0.08})
    assert "edge_distance_new" not in names and names[:2] == ["edge_distance", "edge_valid"]


def test_noise_and_bias_are_gaussian_and_leave_validity_alone():
    seen, true, _ = drive(cars=500, sensor={"noise": 0.04, "bias": 0.2})
    lost = np.isnan(true)
    np.testing.assert_array_equal(seen[..., 1], ~lost)
    error = np.where(lost, np.nan, seen[..., 0] - true)
    offset = np.nanmean(error, axis=0)
    white = ((error - offset) / 0.04)[~lost[:, 0]]
    assert stats.kstest(offset / 0.2, stats.norm.cdf).pvalue > 1e-3
    assert white.std() == pytest.approx(math.sqrt(1 - 1 / len(white)), rel=0.01)
    assert abs(np.corrcoef(white[:-1].ravel(), white[1:].ravel())[0, 1]) < 0.03
    assert stats.kstest(white[::7].ravel()[:10000], stats.norm.cdf).pvalue > 1e-3


def test_lost_pictures_hold_distance_and_validity():
    seen, true, _ = drive(cars=300, sensor={"dropout": 0.25})
    new = seen[..., -1] == 1.0
    assert new[0].all() and 1 - new[1:].mean() == pytest.approx(0.25, abs=0.01)
    old = ~new[1:]
    np.testing.assert_array_equal(seen[1:][old][:, :2], seen[:-1][old][:, :2])
    np.testing.assert_array_equal(seen[..., 1][new], ~np.isnan(true[new]))
    fresh = new & ~np.isnan(true)
    np.testing.assert_allclose(seen[..., 0][fresh], true[fresh], atol=1e-6)


def test_rounding_is_to_the_nearest_step_and_the_bounds_hold():
    seen, true, _ = drive(sensor={"resolution": 0.25})
    fine = ~np.isnan(true)
    np.testing.assert_allclose(seen[..., 0][fine], 0.25 * np.floor(true[fine] / 0.25 + 0.5), atol=1e-6)
    seen, _, _ = drive(cars=50, sensor={"bias": 40.0}, steps=3)
    assert np.abs(seen[..., 0]).max() == 20.0


def test_the_edge_of_the_other_side_has_the_same_distance_in_the_mirror():
    """Mirrored road, state and edge."""
    cars, rng = 100, np.random.default_rng(2)
    d, theta = rng.uniform(-1, 1, (2, cars)) * [[1.0], [0.4]]
    one, _ = shown(cars, {"kind": "circle", "radius": 15.0}, {"lateral_error": d, "heading_error": theta})
    other, _ = shown(
        cars,
        {"kind": "circle", "radius": -15.0},
        {"lateral_error": -d, "heading_error": -theta},
        camera={"edge": "left"},
    )
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_the_last_curvature_goes_on_behind_the_end_of_an_open_road_and_its_edge_is_seen():
    got, _ = shown(3, MarkedStraight(), {"arc_length": [999.0, 996.0, 992.0], "lateral_error": 0.2, "heading_error": 0})
    np.testing.assert_allclose(got, 1.7, atol=1e-10)
