"""Guidance by camera: the van on its circles, its set speeds, starts, errors, and ten thousand random episodes."""

import math
import warnings

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from with_effect import with_effect

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_env import layout as at

ID, TURN_OFF = "lanekeep/CameraLane-v0", "lanekeep/TurnOff-v0"
BASE = 3.0
#: The road wheel follows at once.
IDEAL = {"base": "van", "steering": {"lag": 0.0, "rate_limit": None, "angle_limit": None, "backlash": 0.0}}


def make(cars, name=ID, **keywords):
    return gym.make_vec(name, cars, "vector_entry_point", **keywords)


def rows(env, *which):
    """Rows of the kernel's cars, side by side over the blocks."""
    cars = env.unwrapped._core.cars
    return [np.concatenate([block[row] for block in cars])[: env.num_envs] for row in which]


def column(env, name):
    return [c.name for c in env.unwrapped.channels].index(name)


def driven(speed, angles, seconds, **keywords):
    """World pose (x, y, heading) of the rear axles on a straight, each with its steering angle: (steps + 1, cars)."""
    env = make(
        len(angles),
        road="straight",
        speed=speed,
        vehicle=IDEAL,
        departure="off",
        max_steering_angle=1.4,
        episode_steps=100_000,
        **keywords,
    )
    env.reset(seed=0, options={"arc_length": 100.0, "lateral_error": 0.0, "heading_error": 0.0})
    action = (np.asarray(angles) / 1.4).astype(np.float32)[:, None]
    poses = []
    for _ in range(round(seconds / 0.04)):
        infos = env.step(action)[4]
        poses.append((infos["arc_length"], infos["lateral_error"], infos["heading_error"]))
    return np.array(poses).transpose(1, 0, 2), action[:, 0].astype(float) * 1.4


@pytest.mark.parametrize("speed", [0.5, 3.0, 6.0])
def test_the_van_drives_on_the_circles_of_its_front_and_rear_wheels(speed):
    """Rear axle on l/tan(delta), front wheel on l/sin(delta) about the same centre, the front wheel at speed v."""
    angles = np.array([-0.6, -0.3, -0.05, 0.05, 0.2, 0.6, 1.2])
    (x, y, heading), delta = driven(speed, angles, 6.0)
    rear, front = BASE / np.tan(delta), BASE / np.sin(delta)
    # The road's s is x only while the heading stays below a right angle, which the straight does not ask of a car.
    np.testing.assert_allclose(np.hypot(x - 100.0, y - rear), np.abs(rear)[None, :] * np.ones_like(x), atol=2e-6)
    ahead = x + BASE * np.cos(heading), y + BASE * np.sin(heading)
    np.testing.assert_allclose(
        np.hypot(ahead[0] - 100.0, ahead[1] - rear), np.abs(front)[None, :] * np.ones_like(x), atol=2e-6
    )
    turned = speed * np.sin(delta) / BASE * 0.04 * np.arange(1, len(x) + 1)[:, None]
    np.testing.assert_allclose(np.remainder(heading - turned + 1.0, 2 * np.pi) - 1.0, 0.0, atol=1e-9)
    steps = np.hypot(np.diff(ahead[0], axis=0), np.diff(ahead[1], axis=0))
    chord = 2 * np.abs(front) * np.sin(speed * 0.04 / (2 * np.abs(front)))
    np.testing.assert_allclose(steps, np.broadcast_to(chord, steps.shape), atol=2e-7)


@pytest.mark.parametrize("radius", [5.0, -5.0, 12.0, -60.0])
def test_the_exact_inverse_keeps_the_rear_axle_on_a_circle(radius):
    env = make(1, road={"kind": "circle", "radius": radius}, speed=2.0, vehicle=IDEAL)
    _, infos = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0, "arc_length": 1.0})
    action = np.array([[math.atan(BASE / radius) / 0.6]], np.float32)
    begin, at_start = infos["arc_length"][0], infos["lateral_acceleration"][0]
    for _ in range(60):
        infos = env.step(action)[4]
    assert infos["lateral_error"][0] == pytest.approx(0.0, abs=1e-5)
    assert infos["heading_error"][0] == pytest.approx(0.0, abs=1e-5)
    gone = (infos["arc_length"][0] - begin) % (2 * math.pi * abs(radius))
    assert gone == pytest.approx(2.0 * math.cos(math.atan(BASE / radius)) * 2.4, rel=1e-5)
    lateral = 4.0 / radius * math.cos(math.atan(BASE / radius)) ** 2  # the rear axle's, at v cos(delta)
    assert infos["lateral_acceleration"][0] == pytest.approx(lateral, rel=1e-5)
    assert at_start == pytest.approx(lateral, rel=1e-9)


def test_the_van_starts_steered_along_the_road():
    env = make(500, road={"kind": "yard", "count": 20, "smallest_radius": 6.0}, start_lateral_error=0.0)
    observation, _ = env.reset(seed=0)
    kappa = observation[:, column(env, "planned_curvature_0")]
    np.testing.assert_allclose(observation[:, column(env, "steering_angle")], np.arctan(BASE * kappa), atol=1e-6)
    assert (np.abs(kappa) > 0.05).sum() > 30


def speeds(cars=2000, steps=500, policy=None, **speed):
    """Observed speeds (steps + 1, cars) on a straight that is long enough."""
    env = make(cars, road="straight", speed=speed, departure="off")
    seen = [env.reset(seed=4)[0][:, 2]]
    for k in range(steps):
        action = np.zeros((cars, 1), np.float32) if policy is None else policy(k, cars)
        seen.append(env.step(action)[0][:, 2])
    return np.array(seen, dtype=float)


def test_set_speeds_are_uniform_between_their_bounds_and_stops_have_their_share():
    v = speeds(minimum=1.0, maximum=5.0, hold=2.0, standstill=0.2, acceleration=1e4, steps=400)
    changes = np.flatnonzero((np.diff(v, axis=0) != 0).any(axis=1)) + 1
    np.testing.assert_array_equal(changes, np.arange(51, 401, 50))  # new after each 2 s, held in between
    drawn = v[1::50]
    assert ((drawn == 0.0) | ((drawn >= 1.0) & (drawn <= 5.0 + 1e-6))).all()
    assert (drawn == 0.0).mean() == pytest.approx(0.2, abs=0.015)
    moving = drawn[drawn > 0.0]
    assert stats.kstest(moving, stats.uniform(1.0, 4.0).cdf).pvalue > 1e-3
    following = np.corrcoef(drawn[:-1].ravel(), drawn[1:].ravel())[0, 1]
    assert abs(following) < 0.03


def test_one_set_speed_an_episode_and_one_number_stay_as_they_are():
    v = speeds(cars=200, steps=300, minimum=2.0, maximum=6.0, hold=None, standstill=0.0)
    assert np.ptp(v, axis=0).max() == 0.0 and v.min() >= 2.0 and np.ptp(v[0]) > 3.0
    env = make(3, road="straight", speed=4.0)
    np.testing.assert_array_equal(env.reset(seed=0)[0][:, 2], np.float32(4.0))
    for _ in range(250):
        observation = env.step(np.zeros((3, 1), np.float32))[0]
    np.testing.assert_array_equal(observation[:, 2], np.float32(4.0))


@settings(max_examples=6, deadline=None)
@given(acceleration=st.floats(0.3, 5.0), hold=st.sampled_from([0.4, 1.0, 8.0]), low=st.floats(0.0, 3.0))
def test_the_speed_changes_no_faster_than_allowed_and_reaches_the_set_speed(acceleration, hold, low):
    v = speeds(cars=100, steps=300, minimum=low, maximum=6.0, hold=hold, acceleration=acceleration, standstill=0.3)
    change = np.abs(np.diff(v, axis=0)) / 0.04
    assert change.max() <= acceleration * (1 + 1e-4) + 1e-4 and change.max() > 0.99 * acceleration
    assert v.min() >= 0.0 and v.max() <= 6.0 + 1e-5
    # on the way it goes as fast as it may: what is neither at rest nor at the limit is the last bit of a change
    between = (change > 1e-3) & (change < 0.99 * acceleration)
    assert between.sum() <= 100 * (1 + 12.0 / hold)


def test_two_policies_on_one_key_meet_the_same_set_speeds():
    rng = np.random.default_rng(0)
    idle = speeds(cars=50, hold=1.0)
    busy = speeds(cars=50, hold=1.0, policy=lambda k, n: rng.uniform(-1, 1, (n, 1)).astype(np.float32))
    np.testing.assert_array_equal(idle, busy)


def test_at_standstill_only_the_steering_moves_and_the_van_starts_again():
    env = make(200, road="straight", speed={"hold": 1.0, "standstill": 0.5, "acceleration": 20.0}, departure="off")
    observation, infos = env.reset(seed=1)
    stood = went = turned = 0
    for k in range(300):
        before, angle, place = observation[:, 2], observation[:, 3], (infos["arc_length"], infos["lateral_error"])
        action = np.full((200, 1), math.sin(0.05 * k), np.float32)
        observation, _, _, _, infos = env.step(action)
        still = (before == 0.0) & (observation[:, 2] == 0.0)
        for then, now in zip(place, (infos["arc_length"], infos["lateral_error"]), strict=True):
            np.testing.assert_array_equal(now[still], then[still])
        stood, went = stood + still.sum(), went + ((before == 0.0) & (observation[:, 2] > 0.1)).sum()
        turned += (still & (observation[:, 3] != angle)).sum()
    assert stood > 1000 and went > 100 and turned > 500


def in_lane(name=ID, cars=100, steps=600, **keywords):
    """(road of each car, s, v, lateral acceleration) as the exact inverse drives: the van stays near the centre."""
    env = make(cars, name, vehicle=IDEAL, departure="off", episode_steps=steps, **keywords)
    policy, state = lanekeep_baselines.make("traechtler-inverse", env.unwrapped.scenario), None
    observation, infos = env.reset(seed=2)
    roads = [env.unwrapped.road_set()[k][0] for k in env.unwrapped._core.counters[at.ROAD]]
    shown = []
    for _ in range(steps - 1):
        shown.append([infos[key].copy() for key in ("arc_length", "speed", "lateral_acceleration", "lateral_error")])
        action, state = policy.predict(observation, state)
        observation, _, _, _, infos = env.step(action)
    return roads, np.array(shown).transpose(1, 0, 2)


def test_the_van_slows_down_before_bends():
    """v² |kappa| stays at the limit; the braking before and the acceleration after keep theirs."""
    speed = {"minimum": 6.0, "hold": None, "standstill": 0.0, "lateral_acceleration": 1.5, "acceleration": 1.2}
    roads, (s, v, _, error) = in_lane(road={"kind": "yard", "count": 30, "gap_spacing": None}, speed=speed)
    assert np.abs(error).max() < 1.0
    demand = np.stack([v[:, i] ** 2 * np.abs(road.curvature(s[:, i])) for i, road in enumerate(roads)], axis=1)
    assert demand.max() <= 1.5 * 1.01 and np.quantile(demand, 0.9) > 1.2
    # On the inside of a bend the van passes the profile faster than the centre line does, and brakes that much harder.
    assert np.abs(np.diff(v, axis=0)).max() <= 1.2 * 0.04 * 1.05
    assert v.max() == pytest.approx(6.0, abs=1e-6) and v.min() < 3.0
    assert (v[0] < 5.9).any()  # starts in bends, too
    without = {name: value for name, value in speed.items() if name != "acceleration"}
    _, (_, free, _, _) = in_lane(cars=20, steps=100, speed={**without, "lateral_acceleration": None})
    np.testing.assert_allclose(free, 6.0, atol=1e-12)


def test_the_slowed_speed_is_the_slower_of_profile_and_set_speed():
    """A set speed below what a bend allows is driven through it unchanged."""
    speed = {"minimum": 2.0, "maximum": 2.0, "standstill": 0.0, "lateral_acceleration": 2.5}
    _, (_, v, _, _) = in_lane(road={"kind": "yard", "count": 10, "smallest_radius": 8.0}, speed=speed, steps=200)
    np.testing.assert_allclose(v, 2.0, atol=1e-12)


def test_turning_off_starts_at_the_beginning_of_the_road():
    env = make(1000, TURN_OFF)
    observation, infos = env.reset(seed=0)
    np.testing.assert_array_equal(infos["arc_length"], 0.0)
    for error, limit in ((infos["lateral_error"], 0.1), (infos["heading_error"], math.radians(1.0))):
        assert np.abs(error).max() <= limit and error.std() == pytest.approx(limit / math.sqrt(3), rel=0.06)
    v = observation[:, 2]
    assert stats.kstest(v, stats.uniform(2.0, 4.0).cdf).pvalue > 1e-3
    for _ in range(50):
        again = env.step(np.zeros((1000, 1), np.float32))[0]
    alive = ~np.isin(np.arange(1000), np.flatnonzero(again[:, 2] != v))
    assert alive.mean() > 0.95
    assert len(np.unique(env.unwrapped._core.counters[at.ROAD])) == 64
    anywhere, _ = make(1000, ID).reset(seed=0)
    assert make(1000, ID).reset(seed=0)[1]["arc_length"].max() > 50.0 and len(anywhere) == 1000


def test_turning_off_loses_the_edge_and_finds_it_again():
    roads, _ = in_lane(TURN_OFF, cars=10, steps=10)
    env = make(10, TURN_OFF, vehicle=IDEAL, speed=4.0)
    policy, state = lanekeep_baselines.make("traechtler-inverse", env.unwrapped.scenario), None
    observation, infos = env.reset(seed=2)
    valid, place, error = [], [], []
    for _ in range(500):
        action, state = policy.predict(observation, state)
        observation, _, terminated, _, infos = env.step(action)
        assert not terminated.any()
        valid.append(observation[:, 1] == 1.0), place.append(infos["arc_length"]), error.append(infos["lateral_error"])
    valid, place = np.array(valid), np.array(place)
    for i, road in enumerate(roads):
        turn = road.stations[np.flatnonzero(~road.marked)[0]]
        end = road.stations[np.flatnonzero(~road.marked)[-1] + 1]
        assert valid[place[:, i] < turn - 7.0, i].all()
        assert not valid[(place[:, i] > turn) & (place[:, i] < end - 9.0), i].any()
        assert valid[place[:, i] > end + 1.0, i].all()
    assert np.abs(error).max() < 1.0


def test_the_plan_is_the_curvature_at_fixed_distances():
    env = make(50, plan=12, plan_spacing=0.7, road={"kind": "yard", "count": 8}, departure="off")
    observation, infos = env.reset(seed=0)
    first = column(env, "planned_curvature_0")
    geometry = [env.unwrapped.road_set()[k][0] for k in env.unwrapped._core.counters[at.ROAD]]
    for _ in range(60):
        for i, road in enumerate(geometry):
            ahead = infos["arc_length"][i] + 0.7 * np.arange(12)
            clear = np.abs(ahead[:, None] - road.stations).min(axis=1) > 1e-6
            got = observation[i, first : first + 12]
            np.testing.assert_allclose(got[clear], road.curvature(ahead)[clear], atol=1e-7)
        observation, _, _, _, infos = env.step(np.zeros((50, 1), np.float32))


def test_full_observations_add_the_truth_of_rear_axle_and_motor():
    env = make(20, observation="full", departure="off")
    observation, infos = env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(50):
        observation, _, _, _, infos = env.step(rng.uniform(-0.5, 0.5, (20, 1)).astype(np.float32))
    motor, wheel = rows(env, at.MOTOR, at.STEER)
    np.testing.assert_array_equal(observation[:, column(env, "motor_angle")], motor.astype(np.float32))
    np.testing.assert_array_equal(observation[:, column(env, "steering_angle")], wheel.astype(np.float32))
    for name in ("lateral_error", "heading_error"):
        np.testing.assert_array_equal(observation[:, column(env, name)], infos[name].astype(np.float32))
    assert np.abs(motor - wheel).max() > 0.01


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"camera": {"edge": "up"}}, ["camera.edge='up'", "right, left"]),
        ({"camera": {"look_ahead": -1.0}}, ["camera.look_ahead=-1.0", "> 0", "m"]),
        ({"camera": {"field_of_view": 3.2}}, ["camera.field_of_view=3.2", "<= 2.96", "rad"]),
        ({"camera": {"fov": 1.0}}, ["camera", "fov", "field_of_view"]),
        ({"camera": 3.5}, ["camera=3.5", "mapping"]),
        ({"camra": {}}, ["camra", "camera"]),
        ({"plan": -1}, ["plan=-1", ">= 0"]),
        ({"plan": 2.5}, ["plan=2.5", "whole"]),
        ({"plan_spacing": 0.0}, ["plan_spacing=0.0", ">= ", "m"]),
        ({"speed": -1.0}, ["speed=-1.0", ">= 0", "m/s"]),
        ({"speed": "fast"}, ["speed='fast'", "SetSpeeds"]),
        ({"speed": True}, ["speed=True", "number"]),
        ({"speed": {"minimum": 7.0}}, ["speed.minimum=7.0", "speed.maximum=6.0", "<="]),
        ({"speed": {"standstill": 1.5}}, ["speed.standstill=1.5", "<= 1"]),
        ({"speed": {"hold": 0.05}}, ["speed.hold=0.05", "multiple", "0.04 s"]),
        ({"speed": {"hold": 0.001}}, ["speed.hold=0.001", "multiple", "0.04 s"]),
        ({"speed": {"hold": 0.0}}, ["speed.hold=0.0", "> 0", "None"]),
        ({"speed": {"acceleration": 0.0}}, ["speed.acceleration=0.0", ">= ", "m/s²"]),
        ({"speed": {"lateral_acceleration": 0.0}}, ["speed.lateral_acceleration=0.0", ">= "]),
        ({"speed": {"accel": 1.0}}, ["speed", "accel", "acceleration"]),
        ({"sensors": {"yaw_rate": {}}}, ["yaw_rate", "edge_distance"]),
        ({"sensors": {"edge_distance": {"period": 0.05}}}, ["sensors.edge_distance.period=0.05", "0.04 s"]),
        ({"lane_width": 11.0}, ["radius", "m"]),
        ({"preview": 3}, ["preview", "allowed", "plan"]),
        ({"vehicle": "vann"}, ["vann", "van"]),
    ],
)
def test_wrong_configurations_are_named_in_one_line(keywords, words):
    for make_one in (lambda: gym.make(ID, **keywords), lambda: make(2, **keywords)):
        with pytest.raises((ValueError, TypeError)) as caught:
            make_one()
        assert "\n" not in str(caught.value)
        for word in words:
            assert word in str(caught.value)


def random_keywords(rng):
    """A point of the whole parameter space, down to radii at the van's turning circle."""

    def pick(*values):
        return values[rng.integers(len(values))]

    steering = {
        "lag": pick(0.01, 0.1, 0.25, 0.6),
        "rate_limit": pick(None, 0.1, 0.35, 2.0),
        "backlash": pick(0.0, 0.01, 0.035, 0.3),
        "feedback": pick("road_wheel", "motor"),
        "delay": pick(0.0, 0.0, 0.05),
    }
    radius = float(rng.uniform(2.5, 8.0))
    yard = {"kind": "yard", "count": 6, "length": 150.0, "smallest_radius": radius, "seed": int(rng.integers(9))}
    low = float(rng.uniform(0.1, 6.0))
    return {
        "vehicle": pick("van", "yin", IDEAL, *3 * [{"base": pick("van", "commonroad-1"), "steering": steering}]),
        "road": pick(
            *3 * [yard],
            {**yard, "gap_spacing": pick(None, 3.0, 20.0), "gap_length": pick(0.5, 5.0, 50.0)},
            {"kind": "turn-off", "count": 6, "smallest_radius": radius, "lost": pick(0.0, 1.0, 4.0)},
            {"kind": "circle", "radius": pick(-1.0, 1.0) * radius},
            "straight",
        ),
        "speed": pick(
            0.0,
            float(rng.uniform(0.0, 20.0)),
            {"minimum": 0.0, "maximum": 0.0},
            {"minimum": low, "maximum": low + 2.0, "hold": pick(None, 0.2, 2.0), "standstill": pick(0.0, 0.3, 1.0)},
            {"acceleration": pick(0.2, 50.0), "lateral_acceleration": pick(None, 0.3, 8.0), "hold": 0.4},
        ),
        "camera": {
            "edge": pick("left", "right"),
            "look_ahead": float(rng.uniform(0.1, 6.0)),
            "field_of_view": float(rng.uniform(0.2, 2.9)),
        },
        "plan": pick(0, 4, 20, 40),
        "plan_spacing": float(rng.uniform(0.1, 1.0)),
        "action": pick("steering_angle", "steering_rate"),
        "max_steering_angle": float(rng.uniform(0.2, 1.4)),
        "lane_width": float(rng.uniform(1.0, 4.9)),
        "start_lateral_error": float(rng.uniform(0.0, 0.5)),
        "start_course_error": float(rng.uniform(0.0, 1.0)),
        "departure": pick("terminate", "cost", "off"),
        "observation": pick("measured", "full"),
        "randomisation": pick("nominal", "mismatch", "stress"),
        "sensors": pick(
            None,
            "production",
            "poor",
            {"edge_distance": {"delay": 0.2, "dropout": 0.9, "jump": 30.0, "jump_rate": 1.0}},
        ),
        "control_step": pick(0.04, 0.02),
        "dtype": pick("float64", "float32"),
        "autoreset_mode": pick("next_step", "same_step"),
    }


def test_controllers_that_cannot_drive_the_van_say_so():
    for scenario in (gym.make(ID).unwrapped.scenario, gym.make(ID, observation="full").unwrapped.scenario):
        able = lanekeep_baselines.names(scenario)
        assert "traechtler-inverse" in able and "traechtler-pd" in able
        for name in set(lanekeep_baselines.names()) - set(able):
            with pytest.raises(ValueError, match=name):
                lanekeep_baselines.make(name, scenario)
        assert {"pure-pursuit", "stanley", "yin-lqr"}.isdisjoint(able)


def guide(scenario):
    """The exact inverse, or where the plan is too short for it the PD controller."""
    name = "traechtler-inverse"
    return lanekeep_baselines.make(name if name in lanekeep_baselines.names(scenario) else "traechtler-pd", scenario)


@pytest.mark.parametrize("wanted", [2_000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_random_episodes_give_numbers_inside_their_bounds(wanted):
    """A third of the cars steers straight, a third at random, a third is guided."""
    rng = np.random.default_rng(1992)
    episodes, cars = 0, 120
    while episodes < wanted:
        keywords = random_keywords(rng)
        name = (ID, ID, TURN_OFF)[rng.integers(3)]
        keywords = with_effect(name, keywords)
        env = make(cars, name, max_episode_steps=int(rng.integers(5, 40)), **keywords)
        space, policy, state = env.unwrapped.observation_space, guide(env.unwrapped.scenario), None
        observation, infos = env.reset(seed=int(rng.integers(2**31)))
        over = np.ones(cars, dtype=bool)
        for _ in range(80):
            assert space.contains(observation), keywords
            assert all(np.isfinite(infos[key]).all() for key in infos if key[0] != "_" and key[:5] != "final"), keywords
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                action, state = policy.predict(observation, state, over)
            assert np.isfinite(action).all(), keywords
            action[::3] = 0.0
            action[1::3] = rng.uniform(-1.2, 1.2, action[1::3].shape)
            observation, reward, terminated, truncated, infos = env.step(action)
            assert np.isfinite(reward).all() and (reward <= 0.0).all(), keywords
            over = terminated | truncated
            episodes += int(over.sum())
            for last in infos["final_obs"][over] if "final_obs" in infos else ():
                assert env.unwrapped.single_observation_space.contains(last), keywords
