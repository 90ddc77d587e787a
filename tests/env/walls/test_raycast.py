"""Ray casting and contact against shapely, and the properties that a simulator relies on."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, translate

from lanekeep_env.walls.contact import measure_bodies, measure_sweeps
from lanekeep_env.walls.raycast import SCRATCH_ROWS, beam_table, cast_many

HALF_LENGTH, HALF_WIDTH = 0.25, 0.1


def scan(poses, walls, first_angle=0.0, step=0.1, count=60, reach=np.inf, dtype=np.float64):
    """Ranges (k, count) of a fan from poses (k, 3) to walls (n, 4)."""
    beams = beam_table(count, step, dtype)
    rows = np.ascontiguousarray(np.asarray(walls, dtype).T)
    scratch, ranges = np.empty((SCRATCH_ROWS, rows.shape[1]), dtype), np.empty((len(poses), count), dtype)
    poses = np.asarray(poses, dtype)
    fan = np.empty(beams.shape[1], dtype)
    cast_many(poses, dtype(first_angle), (dtype(step), dtype(reach), beams), rows, scratch, fan, ranges)
    return ranges


def bodies(poses, walls, dtype=np.float64):
    """Distance and contact of the car at poses (k, 3)."""
    rows = np.ascontiguousarray(np.asarray(walls, dtype).T)
    distance, contact = np.empty(len(poses), dtype), np.empty(len(poses), np.bool_)
    scratch = np.empty((1, rows.shape[1]), dtype)
    poses = np.asarray(poses, dtype)
    measure_bodies(poses, dtype(HALF_LENGTH), dtype(HALF_WIDTH), rows, scratch, distance, contact)
    return distance, contact


def swept(poses, walls):
    """Whether a wall may be touched between each pose (k + 1, 3) and the next."""
    rows = np.ascontiguousarray(np.asarray(walls, np.float64).T)
    contact = np.empty(len(poses) - 1, np.bool_)
    measure_sweeps(np.asarray(poses, np.float64), HALF_LENGTH, HALF_WIDTH, rows, np.empty((1, len(walls))), contact)
    return contact


def car(x, y, heading):
    body = shapely.box(-HALF_LENGTH, -HALF_WIDTH, HALF_LENGTH, HALF_WIDTH)
    return translate(rotate(body, heading, origin=(0, 0), use_radians=True), x, y)


def lines(walls):
    return shapely.linestrings(np.asarray(walls).reshape(-1, 2, 2))


coordinate = st.integers(-1000, 1000).map(lambda k: k / 100)
wall = st.tuples(coordinate, coordinate, coordinate, coordinate).filter(lambda w: w[:2] != w[2:])
pose = st.tuples(coordinate, coordinate, st.floats(-7.0, 7.0))


@settings(max_examples=150, deadline=None)
@given(st.lists(wall, min_size=1, max_size=12), pose, st.floats(0.01, 0.09), st.integers(1, 65))
@example([(1.0, -1.0, 1.0, 1.0)], (0.0, 0.0, 0.0), 0.05, 20)
def test_ranges_are_shapelys(walls, pose, step, count):
    x, y, heading = pose
    # A wall seen edge-on has no range that rounding does not decide.
    a, b = np.array(walls)[:, :2] - (x, y), np.array(walls)[:, 2:] - (x, y)
    off = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.hypot(*(b - a).T)
    walls = np.array(walls)[off > 1e-3]
    if len(walls) == 0:
        return
    ranges = scan([pose], walls, -0.3, step, count)[0]
    geometry = lines(walls)
    angles = heading - 0.3 + step * np.arange(count)
    for angle, found in zip(angles, ranges, strict=True):
        beam = shapely.LineString([(x, y), (x + 60 * math.cos(angle), y + 60 * math.sin(angle))])
        hits = shapely.intersection(beam, geometry)
        expected = shapely.distance(shapely.Point(x, y), hits)
        expected = expected[~np.isnan(expected)].min(initial=np.inf)
        if found != expected and abs(found - expected) > 1e-9:
            # A beam past the end of a wall: both answers are right to rounding.
            ends = np.array(walls).reshape(-1, 2) - (x, y)
            past = np.abs(ends[:, 1] * math.cos(angle) - ends[:, 0] * math.sin(angle)) < 1e-11
            assert past.any(), (angle, found, expected)


def test_scans_of_random_worlds_to_a_nanometre():
    rng = np.random.default_rng(1)
    walls = rng.uniform(-10, 10, (200, 4))
    poses = np.column_stack([rng.uniform(-9, 9, (20, 2)), rng.uniform(-4, 4, 20)])
    ranges = scan(poses, walls, -2.0, 0.0037, 1080)
    geometry = shapely.STRtree(lines(walls))
    for (x, y, heading), row in zip(poses, ranges, strict=True):
        for k in range(0, 1080, 37):
            angle = heading - 2.0 + 0.0037 * k
            beam = shapely.LineString([(x, y), (x + 60 * math.cos(angle), y + 60 * math.sin(angle))])
            near = geometry.geometries[geometry.query(beam)]
            distances = shapely.distance(shapely.Point(x, y), shapely.intersection(beam, near))
            assert row[k] == pytest.approx(np.nanmin(distances, initial=np.inf), abs=1e-9)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_no_beam_leaves_through_a_corner(dtype):
    """Beams aimed exactly at the corners of closed rooms, from many poses and headings."""
    rng = np.random.default_rng(2)
    for corners in (3, 4, 8, 40):
        angles = 2 * np.pi * np.arange(corners) / corners
        points = 4.0 * np.column_stack([np.cos(angles), np.sin(angles)])
        room = np.hstack([points, np.roll(points, -1, axis=0)])
        for step in (2 * np.pi / corners, np.pi / corners, 0.01):
            count = int(2 * np.pi / step - 1e-6)
            middle = np.column_stack([np.zeros((50, 2)), 2 * np.pi / corners * np.arange(50)])
            places = rng.uniform(-1, 1, (50, 2))
            at_a_corner = np.arctan2(*(points[0] - places).T[::-1])
            anywhere = np.column_stack([places, at_a_corner])
            ranges = scan(np.concatenate([middle, anywhere]), room, 0.0, step, count, dtype=dtype)
            assert np.isfinite(ranges).all() and (ranges < 8.1).all()


@settings(max_examples=60, deadline=None)
@given(st.lists(wall, min_size=1, max_size=12), pose, st.integers(1, 128))
def test_a_beam_reads_the_same_in_any_fan_and_with_turned_walls(walls, pose, count):
    """Wide fans that go all around, split fans, walls given end first: the same to rounding."""
    step = 2 * math.pi / 128
    ranges = scan([pose], walls, 0.0, step, count)[0]
    backwards = np.array(walls)[:, [2, 3, 0, 1]]
    np.testing.assert_allclose(ranges, scan([pose], backwards, 0.0, step, count)[0], rtol=1e-9)
    lone = np.concatenate([scan([pose], walls, k * step, step, 1)[0] for k in range(count)])
    same = np.isclose(ranges, lone, rtol=1e-7, atol=1e-7) | (ranges == lone)
    # The fan's own rounding decides about beams that graze an end of a wall.
    assert (~same).sum() <= 2 * len(walls)


def test_single_precision_is_near_double():
    rng = np.random.default_rng(3)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 32))
    points = rng.uniform(2, 6, (32, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
    room = np.hstack([points, np.roll(points, -1, axis=0)])
    poses = np.column_stack([rng.uniform(-0.5, 0.5, (200, 2)), rng.uniform(-3, 3, 200)])
    double, single = scan(poses, room), scan(poses, room, dtype=np.float32)
    assert single.dtype == np.float32
    assert np.quantile(np.abs(double - single), 0.99) < 1e-4


def test_reach_glass_order_and_poses_that_are_not_finite():
    room = [(2, -2, 2, 2), (2, 2, -2, 2), (-2, 2, -2, -2), (-2, -2, 2, -2)]
    assert scan([(0, 0, 0)], room, count=1)[0, 0] == 2.0
    assert scan([(0, 0, 0)], room, count=1, reach=1.5)[0, 0] == 1.5
    assert scan([(0, 0, 0)], [(2, 1, 2, 2)], count=1)[0, 0] == np.inf
    assert (scan([(np.nan, 0, 0), (0, 0, np.nan), (np.inf, 0, 0), (1e300, 0, 0)], room, reach=9.0) == 9.0).all()
    # A wall seen exactly from its end has no width.
    assert scan([(0, 0, 0)], [(1, 0, 2, 0)], count=1)[0, 0] == np.inf
    with pytest.raises(ValueError, match="less than a full turn"):
        beam_table(64, 0.2)


@settings(max_examples=300, deadline=None)
@given(st.lists(wall, min_size=1, max_size=12), pose)
def test_clearance_and_contact_are_shapelys(walls, pose):
    expected = shapely.distance(car(*pose), lines(walls)).min()
    distance, contact = bodies([pose], walls)
    assert distance[0] == pytest.approx(expected, abs=1e-9)
    assert contact[0] == (expected == 0.0) or expected < 1e-9
    assert contact[0] == (distance[0] == 0.0)


def test_contact_in_closed_cases():
    beside, ahead = (-5.0, 0.1, 5.0, 0.1), (0.25, -1.0, 0.25, 1.0)
    inside = (-0.01, 0.0, 0.01, 0.0)
    for touching in (beside, ahead, inside):
        distance, contact = bodies([(0, 0, 0)], [touching])
        assert contact[0] and distance[0] == 0.0
    assert bodies([(0, 0, 0)], [(1.25, -1, 1.25, 1)])[0][0] == pytest.approx(1.0)
    assert bodies([(0, 0, 0)], [(1.25, 1.1, 2, 5)], np.float32)[0][0] == pytest.approx(math.sqrt(2.0))


def arc(start, speed, rate, count):
    """Poses along an arc of unit time: exact."""
    x, y, heading = start
    t = np.linspace(0.0, 1.0, count)
    angle = heading + rate * t
    chord = speed * t * np.sinc(rate * t / 2 / np.pi)
    middle = heading + rate * t / 2
    return np.column_stack([x + chord * np.cos(middle), y + chord * np.sin(middle), angle])


@settings(max_examples=150, deadline=None)
@given(
    st.lists(wall, min_size=1, max_size=8),
    pose,
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
)
def test_no_contact_on_the_way_is_missed(walls, start, travel, turn):
    """Contact at any of 200 poses between two is also found from the two alone."""
    way = arc(start, travel, turn, 200)
    _, contact = bodies(way, walls)
    assert swept(way[[0, -1]], walls)[0] or not contact.any()


@settings(max_examples=150, deadline=None)
@given(wall, pose, st.floats(0.0, 1.0), st.floats(-0.1, 0.1))
def test_the_sweep_finds_little_more_than_there_is(wall, start, travel, turn):
    way = arc(start, travel, turn, 2)
    hull = shapely.union(car(*way[0]), car(*way[1])).convex_hull
    bulge = abs(turn) * (travel + abs(turn) * 0.27) / 8 * 1.05
    distance = shapely.distance(hull, lines([wall])).item()
    # Walls near a corner of the hull may count up to half as far again.
    assert distance <= 1.5 * bulge + 1e-9 if swept(way, [wall])[0] else distance > -1.0


def test_a_thin_wall_stops_any_speed():
    short = [(5.0, -0.02, 5.0, 0.02)]
    assert swept([(0, 0, 0), (100, 0, 0)], short)[0]
    assert swept([(0, 0.08, 0.0), (100, 0.08, 0.0)], [(5.0, 0.0, 5.0, 0.02)])[0]
    assert not swept([(0, 0, 0), (4.7, 0, 0)], short)[0]
    assert not swept([(0, 0.13, 0), (100, 0.13, 0)], short)[0]
    assert not swept([(0, 0, 0), (0, 0, 0)], short)[0]
    assert swept([(5, 0, 0), (5, 0, 0)], short)[0]
