"""Ultrasonic sensors against shapely: walls clipped to the cone's polygon, and what the environments show of them."""

import math

import gymnasium as gym
import numba
import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import lanekeep_env  # noqa: F401
from lanekeep_env.sensing.ultrasonic import cone_distance

HALF = math.radians(22.5)
#: Largest distance of a wall from a sensor in these worlds is far below this, m.
FAR = 1e4
WIDE = {"kind": "circuit", "length": 80.0, "width": 80.0, "corridor": 20.0}


@numba.njit(error_model="numpy")
def _measure(poses, tangent, nearest, farthest, walls, scratch, found):
    for i in range(poses.shape[0]):
        x, y, angle = poses[i, 0], poses[i, 1], poses[i, 2]
        pose, cone = (x, y, np.cos(angle), np.sin(angle)), (tangent, nearest, farthest)
        found[i] = cone_distance(pose, cone, walls, (0, walls.shape[1]), scratch)


def measured(poses, walls, half=HALF, nearest=0.03, farthest=6.0):
    """What sensors at poses (k, 3) tell of walls (n, 4), m."""
    poses, rows = np.asarray(poses, np.float64), np.ascontiguousarray(np.asarray(walls, np.float64).T)
    found = np.empty(len(poses))
    _measure(poses, math.tan(half), nearest, farthest, rows, np.empty((1, rows.shape[1])), found)
    return found


def by_polygon(pose, walls, half=HALF, nearest=0.03, farthest=6.0):
    """The same by shapely: each wall clipped to a triangle that reaches far beyond all of them."""
    x, y, angle = pose
    ends = [(x + FAR * math.cos(angle + side), y + FAR * math.sin(angle + side)) for side in (-half, half)]
    cone = shapely.Polygon([(x, y), *ends])
    lines = shapely.linestrings(np.asarray(walls).reshape(-1, 2, 2))
    distance = shapely.distance(shapely.Point(x, y), shapely.intersection(cone, lines))
    least = np.nanmin(distance, initial=np.inf)
    return least if nearest <= least <= farthest else math.nan


def by_bearings(pose, walls, half=HALF):
    """The same without clipping: foot of the perpendicular, ends, and the cone's edges, whichever lie inside it."""
    x, y, angle = pose
    axis = np.array([math.cos(angle), math.sin(angle)])
    best = math.inf
    for x0, y0, x1, y1 in walls:
        a, along = np.array([x0 - x, y0 - y]), np.array([x1 - x0, y1 - y0])
        shares = [0.0, 1.0, -(a @ along) / (along @ along)]
        for side in (-half, half):
            normal = np.array([-math.sin(angle + side), math.cos(angle + side)])
            if along @ normal != 0.0:
                shares.append(-(a @ normal) / (along @ normal))
        for share in shares:
            if 0.0 <= share <= 1.0:
                point = a + share * along
                length = math.hypot(*point)
                if point @ axis >= length * math.cos(half) - 1e-12:
                    best = min(best, length)
    return best


coordinate = st.integers(-600, 600).map(lambda k: k / 100)
wall = st.tuples(coordinate, coordinate, coordinate, coordinate).filter(lambda w: w[:2] != w[2:])
pose = st.tuples(coordinate, coordinate, st.floats(-7.0, 7.0))


def test_random_worlds_to_a_nanometre_of_shapely():
    rng = np.random.default_rng(4)
    echoes = 0
    for count in (1, 3, 10, 40):
        for _ in range(40):
            walls = rng.uniform(-6, 6, (count, 4))
            poses = np.column_stack([rng.uniform(-5, 5, (12, 2)), rng.uniform(-4, 4, 12)])
            expected = [by_polygon(one, walls) for one in poses]
            np.testing.assert_allclose(measured(poses, walls), expected, atol=1e-9)
            echoes += np.isfinite(expected).sum()
    assert 600 < echoes < 1900  # both answers occurred often


@settings(max_examples=300, deadline=None)
@given(st.lists(wall, min_size=1, max_size=8), pose, st.floats(0.02, 1.5))
@example([(1.0, -1.0, 1.0, 1.0)], (0.0, 0.0, 0.0), HALF)
@example([(1.0, 1.0, -1.0, 1.0)], (0.0, 0.0, 0.0), math.pi / 4)
def test_any_cone_and_walls_through_corners_and_sensors(walls, place, half):
    found = measured([place], walls, half, 0.0, FAR)[0]
    # A point on the cone's very edge is inside or not by rounding: a slightly wider and narrower cone bound the answer.
    wide, narrow = by_bearings(place, walls, half + 1e-9), by_bearings(place, walls, half - 1e-9)
    assume(wide > 1e-3)  # a sensor on a wall is a car in contact
    found = math.inf if math.isnan(found) else found
    assert wide - 1e-6 <= found <= narrow + 1e-6


def test_range_limits_belong_to_the_range():
    at = [(2.0, -9.0, 2.0, 9.0)]
    for nearest, farthest, seen in ((2.0, 6.0, True), (0.03, 2.0, True), (2.0 + 1e-9, 6.0, False), (0.03, 1.99, False)):
        assert (measured([(0, 0, 0)], at, HALF, nearest, farthest)[0] == 2.0) == seen
    # A wall that is too near hides what is behind it.
    assert np.isnan(measured([(0, 0, 0)], [(0.02, -1, 0.02, 1), *at])[0])
    # One behind the sensor does not.
    assert measured([(0, 0, 0)], [(-0.02, -1, -0.02, 1), *at])[0] == 2.0


@pytest.mark.parametrize("degrees", [0.0, 10.0, 22.0])
def test_a_plane_wall_is_seen_squarely_while_the_foot_is_in_the_cone(degrees):
    turn = math.radians(degrees)
    plane = [(1.0, -9.0, 1.0, 9.0)]
    assert measured([(0, 0, turn)], plane)[0] == pytest.approx(1.0, abs=1e-12)
    beyond = HALF + turn + 0.1
    assert measured([(0, 0, beyond)], plane)[0] == pytest.approx(1.0 / math.cos(beyond - HALF), rel=1e-12)


def poses_of(infos):
    return np.column_stack([infos["x"], infos["y"], infos["heading_error"]])


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_environment_shows_the_three_sensors_from_their_places(dtype):
    """Sides: on the car's axis, half the wheelbase ahead of the rear axle; front: at the nose."""
    cars = 60
    car = {"base": "knightriders", "cg_to_front_axle": 0.2, "cg_to_rear_axle": 0.15}
    env = gym.make_vec(
        "lanekeep/WallFollow-v0",
        cars,
        "vector_entry_point",
        vehicle=car,
        world={"kind": "corridor", "length": 30.0, "width": 4.0},
        dtype=dtype,
    )
    walls = env.unwrapped.world_set()[0].segments
    rng = np.random.default_rng(1)
    starts = {"lateral_error": rng.uniform(-0.5, 0.5, cars), "heading_error": rng.uniform(-3.1, 3.1, cars)}
    observation, infos = env.reset(seed=3, options=starts)
    for _ in range(15):
        side, nose = 0.5 * 0.35 - 0.15, 0.5 * (0.2 - 0.15) + 0.5 * 0.532
        for column, turn, arm in ((0, -math.pi / 2, side), (1, math.pi / 2, side), (2, 0.0, nose)):
            for i, (x, y, heading) in enumerate(poses_of(infos)):
                place = (x + arm * math.cos(heading), y + arm * math.sin(heading), heading + turn)
                expected = by_polygon(place, walls)
                # A corner at the cone's edge may be seen in one precision and not in the other.
                edges = [by_polygon(place, walls, HALF + change) for change in (-1e-5, 1e-5)]
                if np.isnan(edges).any() or np.ptp(edges) > 1e-3:
                    continue
                shown = 0.0 if math.isnan(expected) else expected
                assert observation[i, column] == pytest.approx(shown, abs=2e-6 if dtype == "float64" else 3e-5)
        observation, _, _, _, infos = env.step(rng.uniform(-1, 1, (cars, 1)).astype(np.float32))


def test_without_an_echo_the_channel_is_zero_and_the_distance_the_range():
    env = gym.make("lanekeep/WallFollow-v0", world=WIDE, set_distance=5.0)
    observation, info = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    names = [channel.name for channel in env.unwrapped.channels]
    shown = dict(zip(names, observation.tolist(), strict=True))
    assert shown["distance_right"] == pytest.approx(5.0) and shown["distance_left"] == shown["distance_front"] == 0.0
    observation, info = env.reset(options={"lateral_error": 1.5, "heading_error": 0.0})
    assert observation[0] == 0.0 and info["distance"] == 6.0 and info["lateral_error"] == pytest.approx(1.0)


def test_a_noisy_sensor_without_an_echo_still_shows_zero():
    env = gym.make_vec(
        "lanekeep/WallFollow-v0",
        50,
        "vector_entry_point",
        sensors={name: {"noise": 0.5, "bias": 0.5} for name in ("distance_right", "distance_left")},
        world=WIDE,
        set_distance=5.0,
    )
    observation, _ = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    for _ in range(5):
        assert (observation[:, 1] == 0.0).all() and (observation[:, 0] > 0.0).all()
        assert observation[:, 0].std() > 0.1
        observation = env.step(np.zeros((50, 1), np.float32))[0]
