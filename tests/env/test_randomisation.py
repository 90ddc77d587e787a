"""Randomised cars and sensors with faults: distributions, pairing, and nothing where they are off."""

import math

import gymnasium as gym
import numpy as np
import pytest
from scipy import stats
from with_effect import with_effect

from lanekeep_env import RANDOMISATIONS, VEHICLES, Sensor
from lanekeep_env import layout as at

ID = "lanekeep/LaneKeep-v0"


def make(cars, **keywords):
    return gym.make_vec(ID, cars, "vector_entry_point", **keywords)


def rows(env, *which):
    """Rows of the kernel's cars, side by side over the blocks."""
    cars = env.unwrapped._core.cars
    return [np.concatenate([block[row] for block in cars])[: env.num_envs] for row in which]


def column(env, name):
    return [c.name for c in env.unwrapped.channels].index(name)


def test_nominal_is_the_plain_environment_bit_for_bit():
    plain, nominal = make(40), make(40, randomisation="nominal", sensors=None)
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(plain.reset(seed=3)[0], nominal.reset(seed=3)[0])
    for _ in range(60):
        actions = rng.uniform(-0.1, 0.1, (40, 1)).astype(np.float32)
        for a, b in zip(plain.step(actions)[:4], nominal.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(a, b)


def test_cars_are_drawn_uniformly_and_independently():
    bounds = RANDOMISATIONS["stress"]
    env = make(5000, randomisation="stress", tyre="magic_formula")
    env.reset(seed=0)
    front, rear, mass, inertia, stiff_f, stiff_r, peak_f, peak_r, delay, response = rows(
        env, *range(at.CAR, at.CAR + 8), at.DELAY, at.STEER_RESPONSE
    )
    car = VEHICLES["yin"]
    factor = 1 / mass / car.mass
    drawn = {
        "mass": factor,
        "cg_shift": car.cg_to_front_axle - front,
        "front_cornering_stiffness": stiff_f / car.front_cornering_stiffness,
        "rear_cornering_stiffness": stiff_r / car.rear_cornering_stiffness,
        "friction": (peak_f + peak_r) / (factor * car.mass * 9.81),
        "steering_lag": -0.005 / np.log1p(-response) / car.steering.lag,
    }
    for name, values in drawn.items():
        low, high = getattr(bounds, name)
        assert stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > 1e-3, name
    correlation = np.corrcoef(list(drawn.values()))
    assert np.abs(correlation - np.eye(len(drawn))).max() < 0.06
    np.testing.assert_allclose(front + rear, car.wheelbase, rtol=1e-12)
    np.testing.assert_allclose(1 / inertia, car.yaw_inertia * factor, rtol=1e-9)
    assert set(np.unique(delay)) == set(range(9))


def test_the_speed_profile_stays_within_the_friction():
    env = make(3000, randomisation={"friction": (0.2, 1.0)}, tyre="magic_formula", observation="full")
    observation, infos = env.reset(seed=1)
    peak_f, peak_r, mass = rows(env, at.FRONT_PEAK, at.REAR_PEAK, at.INVERSE_MASS)
    friction = (peak_f + peak_r) * mass / 9.81
    demand = infos["speed"] ** 2 * np.abs(observation[:, column(env, "curvature")])
    assert (demand <= 0.8 * friction * 9.81 * (1 + 1e-5) + 1e-9).all()
    assert demand.max() > 0.39 * 9.81  # and on a good road it uses its 0.4 g


def run_noise(policy, cars=30, steps=50, **keywords):
    """Recorded sensor errors (observed minus true) of the measured channels, and the cars."""
    env = make(cars, departure="off", **keywords)
    observation, infos = env.reset(seed=5)
    errors = []
    for k in range(steps):
        observation, _, _, _, infos = env.step(policy(k, observation))
        truth = np.stack([infos["lateral_error"], infos["heading_error"], rows(env, at.YAW_RATE)[0], infos["speed"]], 1)
        errors.append(observation[:, :4] - truth)
    return np.array(errors), rows(env, at.INVERSE_MASS, at.FRONT_STIFFNESS)


def test_two_policies_on_one_key_meet_the_same_car_and_the_same_noise():
    sensors = {
        "lateral_error": {"noise": 0.1, "bias": 0.2, "jump": 0.5, "jump_rate": 2.0},
        "heading_error": {"noise": 0.01},
        "yaw_rate": {"noise": 0.02, "bias": 0.01},
    }
    keywords = {"sensors": sensors, "randomisation": "stress", "tyre": "magic_formula"}
    idle, cars = run_noise(lambda k, o: np.zeros((len(o), 1), np.float32), **keywords)
    busy, same = run_noise(lambda k, o: np.float32(-0.3 * o[:, :1] - 3 * o[:, 1:2] + 0.05 * math.sin(k)), **keywords)
    np.testing.assert_array_equal(cars, same)
    assert np.abs(idle[..., :3]).max() > 0.3
    np.testing.assert_allclose(idle[..., :3], busy[..., :3], atol=3e-6)  # float32 of the observation
    np.testing.assert_allclose(idle[..., 3], 0.0, atol=3e-6)


def observed(sensor, channel="lateral_error", steps=400, cars=200, **keywords):
    """Truth and observation of one channel on a straight road, with a gently moving car: (steps, cars) each."""
    env = make(cars, road="straight", speed=20.0, departure="off", sensors={channel: sensor}, **keywords)
    where = column(env, channel)
    observation, infos = env.reset(seed=9)
    seen, truth = [observation], [infos["lateral_error"].copy()]
    for k in range(steps):
        action = np.full((cars, 1), 0.03 * math.cos(0.3 * k), np.float32)
        observation, _, _, _, infos = env.step(action)
        seen.append(observation)
        truth.append(infos["lateral_error"].copy())
    seen = np.array(seen)
    return np.array(truth), seen[..., where], seen


def test_noise_is_white_and_gaussian():
    truth, seen, _ = observed({"noise": 0.05})
    error = (seen - truth) / 0.05
    assert stats.kstest(error[::3].ravel()[:20000], stats.norm.cdf).pvalue > 1e-3
    assert abs(np.corrcoef(error[:-1].ravel(), error[1:].ravel())[0, 1]) < 0.02
    assert abs(np.corrcoef(error[:, :-1].ravel(), error[:, 1:].ravel())[0, 1]) < 0.02


def test_bias_is_constant_within_an_episode_and_gaussian_over_them():
    truth, seen, _ = observed({"bias": 0.2}, steps=20, cars=3000)
    error = seen - truth
    np.testing.assert_allclose(error, np.broadcast_to(error[0], error.shape), atol=1e-5)
    assert stats.kstest(error[0] / 0.2, stats.norm.cdf).pvalue > 1e-3


def test_resolution_rounds_to_the_nearest_step():
    truth, seen, _ = observed({"resolution": 0.25})
    np.testing.assert_allclose(seen, 0.25 * np.floor(truth / 0.25 + 0.5), atol=1e-6)


def test_period_and_delay_hold_and_shift():
    truth, seen, full = observed({"period": 0.2, "delay": 0.15})
    steps = np.arange(len(truth))
    sampled = steps // 4 * 4
    np.testing.assert_allclose(seen, truth[np.maximum(sampled - 3, 0)], atol=1e-6)
    np.testing.assert_array_equal(full[..., -1], np.broadcast_to((steps % 4 == 0)[:, None], seen.shape))


def test_dropouts_hold_the_last_sample_at_the_stated_rate():
    truth, seen, full = observed({"dropout": 0.3})
    new = full[..., -1] == 1.0
    np.testing.assert_allclose(seen[new], truth[new], atol=1e-6)
    held = ~new[1:]
    np.testing.assert_array_equal(seen[1:][held], seen[:-1][held])
    assert new[0].all()
    assert 1 - new[1:].mean() == pytest.approx(0.3, abs=0.01)


def test_jumps_come_at_the_stated_rate_and_size():
    truth, seen, _ = observed({"jump": 2.0, "jump_rate": 1.0})
    error = seen - truth
    changes = np.abs(np.diff(error, axis=0)) > 1e-4
    assert changes.mean() / 0.05 == pytest.approx(1.0, rel=0.1)
    assert np.abs(error).max() <= 2.0 + 1e-5 and np.abs(error).max() > 1.9


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"randomisation": "stres"}, ["stres", "stress"]),
        ({"randomisation": {"mas": [1, 2]}}, ["mas", "mass"]),
        ({"randomisation": {"mass": [2, 1]}}, ["randomisation.mass", "low <= high"]),
        ({"randomisation": {"friction": -1}}, ["randomisation.friction", ">= 0.05"]),
        ({"randomisation": 3}, ["randomisation=3"]),
        ({"sensors": "bad"}, ["sensors", "poor"]),
        ({"sensors": {"yawrate": {}}}, ["yawrate", "yaw_rate"]),
        ({"sensors": {"yaw_rate": {"nois": 1}}}, ["nois", "noise"]),
        ({"sensors": {"yaw_rate": {"noise": -1}}}, ["sensors.yaw_rate.noise", ">= 0"]),
        ({"sensors": {"yaw_rate": {"period": 0.07}}}, ["sensors.yaw_rate.period", "0.05 s"]),
        ({"sensors": {"yaw_rate": {"dropout": 2}}}, ["sensors.yaw_rate.dropout", "<= 1"]),
    ],
)
def test_wrong_settings_are_named(keywords, words):
    with pytest.raises(ValueError) as caught:
        gym.make(ID, **keywords)
    for word in words:
        assert word in str(caught.value)


def random_keywords(rng):
    """A point of the whole parameter space."""

    def pick(*values):
        return values[rng.integers(len(values))]

    keywords = {
        "vehicle": pick("yin", "commonroad-1", "commonroad-3", {"steering": {"lag": 0.0, "delay": 0.03}}),
        "dynamics": pick("dynamic", "dynamic", "kinematic"),
        "tyre": pick("linear", "magic_formula"),
        "friction": float(rng.uniform(0.1, 1.2)),
        "road": pick("random", "yin", "sine", "slalom", "roadworks", "straight", {"kind": "circle", "radius": -25.0}),
        "speed": pick(None, 0.0, 0.3, 5.0, 45.0, {"lateral_acceleration": 8.0}),
        "action": pick("steering_angle", "steering_rate"),
        "max_steering_angle": float(rng.uniform(0.05, 1.2)),
        "departure": pick("terminate", "cost", "off"),
        "preview": int(rng.integers(0, 12)),
        "observation": pick("measured", "full"),
        "randomisation": pick("nominal", "mismatch", "stress"),
        "sensors": pick(None, "production", "poor"),
        "control_step": pick(0.05, 0.05, 0.01),
        "dtype": pick("float64", "float32"),
        "autoreset_mode": pick("next_step", "same_step"),
    }
    return keywords


@pytest.mark.parametrize("wanted", [200_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_random_steps_over_the_whole_parameter_space(wanted):
    """No NaN, no exception, observations inside their bounds."""
    rng = np.random.default_rng(2026)
    cars, steps, done = 256, 80, 0
    while done < wanted:
        keywords = random_keywords(rng)
        name = ("lanekeep/LaneKeep-v0", "lanekeep/RoadWorks-v0")[int(rng.integers(2))]
        keywords = with_effect(name, keywords)
        env = gym.make_vec(name, cars, "vector_entry_point", max_episode_steps=50, **keywords)
        low, high = env.observation_space.low, env.observation_space.high
        env.reset(seed=int(rng.integers(2**31)))
        for _ in range(steps):
            actions = rng.uniform(-1.2, 1.2, (cars, 1)).astype(np.float32)
            observation, reward, _, _, infos = env.step(actions)
            assert ((observation >= low) & (observation <= high)).all(), keywords
            assert np.isfinite(reward).all(), keywords
            assert all(np.isfinite(infos[k]).all() for k in ("lateral_error", "heading_error", "arc_length")), keywords
            done += cars


def test_sensor_record_is_plain():
    assert Sensor() == Sensor(noise=0.0)
