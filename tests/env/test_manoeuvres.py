"""Evasive paths and paths driven backwards: closed forms, and the same car by scipy in world coordinates."""

import math

import gymnasium as gym
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_env import VEHICLES
from lanekeep_env.roads import EvasiveRoads, ParkingPaths

EVASIVE, REVERSE = "lanekeep/Evasive-v0", "lanekeep/ReversePath-v0"
IDEAL = {"base": "passat", "steering": {"lag": 0.0, "rate_limit": None, "angle_limit": None, "delay": 0.0}}
WHEELBASE = VEHICLES["passat"].wheelbase
U = Polynomial([0, 0, 0, 10, -15, 6])


def column(env, name):
    return [c.name for c in env.unwrapped.channels].index(name)


@pytest.mark.parametrize(("shift", "length"), [(3.5, 36.7), (2.0, 15.0), (5.0, 10.0)])
def test_an_evasive_path_is_the_quintic_in_world_coordinates(shift, length):
    roads = EvasiveRoads(shift=shift, shift_length=length, before=5.0).build()
    assert [road.name for road in roads] == ["evasive-left", "evasive-right"]
    for road, side in zip(roads, (1.0, -1.0), strict=True):
        s = np.linspace(0.0, road.length, 4000)
        x, y = road.position(s).T
        u = np.clip((x - 5.0) / length, 0.0, 1.0)
        np.testing.assert_allclose(y, side * shift * U(u), atol=1e-3)
        slope, bend = U.deriv()(u) * shift / length, U.deriv(2)(u) * shift / length**2
        np.testing.assert_allclose(road.heading(s), side * np.arctan(slope), atol=1e-3)
        curvature = side * bend / (1 + slope**2) ** 1.5
        np.testing.assert_allclose(road.curvature(s), curvature, atol=0.01 * np.abs(curvature).max())
        # its length, by scipy
        way = quad(lambda u: length * math.hypot(1.0, U.deriv()(u) * shift / length), 0.0, 1.0, epsabs=1e-10)[0]
        end = brentq(lambda s, road=road: road.position(s)[0] - 5.0 - length, way, road.length)
        assert end == pytest.approx(5.0 + way, abs=1e-3)


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_side_is_that_one_of_both(side):
    (road,) = EvasiveRoads(side=side).build()
    twin = EvasiveRoads().build()[side == "right"]
    np.testing.assert_array_equal(road.curvature_start, twin.curvature_start)


def test_the_evasive_path_asks_for_the_lateral_acceleration_of_its_quintic():
    env = gym.make(EVASIVE)
    env.reset(seed=0)
    u = np.linspace(0.0, 1.0, 100_001)
    slope, bend = U.deriv()(u) * 3.5 / 36.7, U.deriv(2)(u) * 3.5 / 36.7**2
    expected = np.abs(bend / (1 + slope**2) ** 1.5).max() * (55.0 / 3.6) ** 2
    for road, _ in env.unwrapped.road_set():
        assert (55.0 / 3.6) ** 2 * road.peak_curvature == pytest.approx(expected, rel=2e-3)


def test_an_evasive_episode_starts_at_the_start_of_the_path_along_it():
    env = gym.make_vec(EVASIVE, 400, "vector_entry_point")
    _, info = env.reset(seed=0)
    assert (info["arc_length"] == 0.0).all() and (info["heading_error"] == 0.0).all()
    np.testing.assert_allclose(info["speed"], 55.0 / 3.6, rtol=1e-12)
    assert 0.75 < np.abs(info["lateral_error"]).max() <= 0.8


def test_parking_paths_keep_their_radii_and_join_without_a_jump():
    spec = ParkingPaths(count=100, smallest_radius=6.0, largest_radius=9.0, transition=2.0)
    roads = spec.build()
    assert len(roads) == 100
    signs = set()
    for road in roads:
        np.testing.assert_allclose(road.curvature_start[1:], road.curvature_end[:-1], atol=1e-12)
        assert road.curvature_start[0] == road.curvature_end[-1] == 0.0
        arcs = (road.curvature_start == road.curvature_end) & (road.curvature_start != 0.0)
        assert arcs.sum() == 4
        radii = 1.0 / np.abs(road.curvature_start[arcs])
        assert (radii >= 6.0).all() and (radii <= 9.0).all()
        assert road.peak_curvature <= 1 / 6.0 + 1e-12
        ramps = road.curvature_start != road.curvature_end
        np.testing.assert_allclose(road.lengths[ramps], 2.0)
        signs |= set(np.sign(road.curvature_start[arcs]))
    assert signs == {-1.0, 1.0}
    again, other = spec.build(), ParkingPaths(count=100, seed=1).build()
    assert all((a.lengths == b.lengths).all() for a, b in zip(roads, again, strict=True))
    assert any((a.lengths != b.lengths).any() for a, b in zip(roads, other, strict=True))


def test_the_passat_can_drive_the_parking_paths():
    assert math.tan(0.6) / WHEELBASE > 1 / ParkingPaths().smallest_radius


def backing(road, speed, **keywords):
    keywords = {"departure": "off", "control_step": 0.01, "episode_steps": 4000, **keywords}
    return gym.make(REVERSE, road=road, speed=speed, vehicle=IDEAL, **keywords)


def world(state, speed, steer, dt):
    """The rear axle of a car with ``speed`` (negative backwards) after ``dt``, by scipy."""

    def rates(_, x):
        return [speed * math.cos(x[2]), speed * math.sin(x[2]), speed * math.tan(steer) / WHEELBASE]

    return solve_ivp(rates, (0.0, dt), state, rtol=1e-11, atol=1e-12).y[:, -1]


def sent(angle):
    """An action for a road-wheel angle, and that angle after the action's way through float32."""
    action = np.clip(np.array([angle / 0.6], np.float32), -1, 1)
    return action, float(action[0]) * 0.6


@pytest.mark.parametrize("radius", [8.0, -8.0])
def test_backwards_round_a_circle_the_errors_are_those_of_the_world(radius):
    """A circle's path coordinates are closed forms: distance from its centre, and angle round it."""
    env = backing({"kind": "circle", "radius": radius}, 1.2)
    env.reset(seed=0, options={"arc_length": 4.0, "lateral_error": 0.3, "heading_error": 0.05})
    phi = 4.0 / radius
    centre, r, side = np.array([0.0, radius]), radius - 0.3, math.copysign(1.0, radius)
    state = np.array([r * math.sin(phi), radius - r * math.cos(phi), phi + 0.05])
    rng = np.random.default_rng(0)
    steer = 0.0
    for k in range(600):
        if k % 20 == 0:
            action, steer = sent(math.atan(WHEELBASE / radius) + rng.uniform(-0.1, 0.1))
        state = world(state, -1.2, steer, 0.01)
        info = env.step(action)[4]
        away = state[:2] - centre
        d = side * (abs(radius) - math.hypot(*away))
        turn = (state[2] - math.atan2(side * away[0], -side * away[1]) + math.pi) % (2 * math.pi) - math.pi
        assert info["lateral_error"] == pytest.approx(d, abs=1e-6)
        assert info["heading_error"] == pytest.approx(turn, abs=1e-6)
        assert info["speed"] == pytest.approx(-1.2, abs=1e-12)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_backwards_along_a_path_the_car_stands_where_scipy_has_it(seed):
    env = backing({"kind": "parking", "count": 5, "seed": seed}, 1.0)
    env.reset(seed=seed, options={"lateral_error": 0.1, "heading_error": -0.04, "road_index": seed})
    road = env.unwrapped.road_set()[seed][0]
    s, d, theta = road.length, 0.1, -0.04
    state = np.array([*road.position(s, d), road.heading(s) + theta])
    steps = 0
    while s > 2.0:
        # feedback along the driven path, whose errors grow where those of the path shrink
        kappa = float(road.curvature(s))
        action, steer = sent(math.atan(WHEELBASE * (kappa - 0.5 * d + 1.4 * theta)))
        state = world(state, -1.0, steer, 0.01)
        info = env.step(action)[4]
        s, d, theta = info["arc_length"], info["lateral_error"], info["heading_error"]
        np.testing.assert_allclose(road.position(s, d), state[:2], atol=1e-3)
        assert (state[2] - road.heading(s) - theta + math.pi) % (2 * math.pi) - math.pi == pytest.approx(0, abs=1e-3)
        steps += 1
    assert steps > 1000 and abs(d) < 0.3


def test_on_a_straight_path_left_stays_left():
    """A car that backs up pointing left of the path goes to the right of it; steering left turns it clockwise."""
    env = backing("straight", 1.0)
    env.reset(seed=0, options={"arc_length": 50.0, "lateral_error": 0.0, "heading_error": 0.1})
    for _ in range(100):
        observation, _, _, _, info = env.step(np.zeros(1, np.float32))
    assert info["lateral_error"] == pytest.approx(-math.sin(0.1), abs=1e-9)
    assert info["arc_length"] == pytest.approx(50.0 - math.cos(0.1), abs=1e-9)
    assert info["heading_error"] == pytest.approx(0.1, abs=1e-12)
    assert observation[column(env, "speed")] == -1.0
    observation, _, _, _, info = env.step(np.ones(1, np.float32))
    assert info["heading_error"] < 0.1 and observation[column(env, "yaw_rate")] < 0.0


def test_the_preview_looks_where_the_car_goes():
    env = backing({"kind": "parking", "count": 3}, 1.0, preview=21, preview_interval=0.5)
    observation, info = env.reset(seed=0, options={"road_index": 1})
    road = env.unwrapped.road_set()[1][0]
    first = column(env, "curvature_preview_0")
    action = np.zeros(1, np.float32)
    for _ in range(200):
        expected = road.curvature(info["arc_length"] - 0.5 * np.arange(21))
        np.testing.assert_allclose(observation[first : first + 21], expected, atol=1e-6)
        observation, _, _, _, info = env.step(action)
    assert np.abs(expected).max() > 0.05


def test_behind_the_start_of_the_path_the_preview_is_that_of_the_start():
    env = backing({"kind": "parking", "count": 1}, 1.0, preview=21, preview_interval=1.0)
    observation, _ = env.reset(seed=0, options={"arc_length": 1.0})
    first = column(env, "curvature_preview_0")
    np.testing.assert_array_equal(observation[first : first + 21], 0.0)


def test_a_reverse_episode_starts_at_the_end_of_its_path():
    env = gym.make_vec(REVERSE, 500, "vector_entry_point")
    _, info = env.reset(seed=1)
    lengths = np.array([road.length for road, _ in env.unwrapped._core.road_set()])
    which = env.unwrapped._core.counters[4]
    np.testing.assert_allclose(info["arc_length"], lengths[which], atol=1e-9)
    assert len(np.unique(which)) > 60
    assert (info["speed"] <= -0.5).all() and (info["speed"] >= -1.5).all() and np.ptp(info["speed"]) > 0.95
    assert np.abs(info["lateral_error"]).max() <= 0.2
    assert np.abs(info["heading_error"]).max() <= math.radians(3.0)


@pytest.mark.parametrize(("sensors", "every"), [("production", 2), ("poor", 5)])
@pytest.mark.parametrize("task", ["Evasive", "ReversePath", "Drive"])
def test_the_named_sensors_work_at_the_control_step_of_manoeuvres(task, sensors, every):
    env = gym.make(f"lanekeep/{task}-v0", sensors=sensors)
    column = [channel.name for channel in env.unwrapped.channels].index("heading_error_new")
    env.reset(seed=0)
    flags = [env.step(np.zeros(env.action_space.shape, dtype=np.float32))[0][column] for _ in range(10)]
    assert sum(flags) <= 10 / every and (sensors == "poor" or sum(flags) == 5)


def test_a_cusp_is_driven_backwards_and_forwards():
    """Set speeds of both signs: the law in arc length (W08 (23)) holds the path either way."""
    keywords = {"speed": {"minimum": -1.0, "maximum": 1.0, "hold": 4.0, "lateral_acceleration": None}}
    env = gym.make_vec("lanekeep/ReversePath-v0", 16, "vector_entry_point", **keywords)
    policy = lanekeep_baselines.make("werling-reverse", env.unwrapped.scenario)
    observation, info = env.reset(seed=0)
    state, before, speeds, steps = None, info["arc_length"], [], []
    for _ in range(1200):
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        assert not terminated.any() and not truncated.any()
        speeds.append(info["speed"].copy())
        steps.append(info["arc_length"] - before)
        before = info["arc_length"].copy()
        assert (np.abs(info["lateral_error"]) < 0.3).all()
    speeds, steps = np.array(speeds), np.array(steps)
    assert ((speeds < -0.3).any(axis=0) & (speeds > 0.3).any(axis=0)).mean() > 0.8
    quick = np.abs(speeds) > 0.1
    assert (np.sign(steps[quick]) == np.sign(speeds[quick])).all()


@pytest.mark.parametrize("name", ["lanekeep/CameraLane-v0", "lanekeep/LaneKeep-v0"])
def test_other_cars_are_not_driven_backwards(name):
    with pytest.raises(ValueError, match=r"speed\.minimum"):
        gym.make(name, speed={"minimum": -1.0, "maximum": 1.0})
