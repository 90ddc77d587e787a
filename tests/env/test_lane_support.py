"""`LaneSupport-v0`: the driver, the mixing of driver and assistant, and what is counted."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest
from scipy.linalg import expm

from lanekeep_env import LaneSupportScenario
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import Driver
from lanekeep_env.scenario.driver import DRIVERS

NOBODY = {"lapse_rate": 0.0, "wander": 0.0, "frequency": 0.0, "preview_time": 0.0, "lag": 0.0}


def vector(cars=64, **keywords):
    settings = {"departure": "cost", "autoreset_mode": "disabled", **keywords}
    return gym.make_vec("lanekeep/LaneSupport-v0", cars, "vector_entry_point", **settings).unwrapped


def column(env, name):
    return env.scenario.column(name)


def test_a_driver_without_corrections_steers_the_steady_curve() -> None:
    """delta = (l + (m_f/C_f - m_r/C_r) v²) kappa of the linear single track, and the car stays in its lane."""
    env = gym.make("lanekeep/LaneSupport-v0", driver=NOBODY, road={"kind": "circle", "radius": 400.0}, speed=25.0)
    env.reset(seed=0, options={"lateral_error": 0.0})
    car = VEHICLES["yin"]
    front = car.mass * car.cg_to_rear_axle / car.wheelbase / car.front_cornering_stiffness
    rear = car.mass * car.cg_to_front_axle / car.wheelbase / car.rear_cornering_stiffness
    for _ in range(40):
        observation, _, _, _, info = env.step(np.zeros(2, dtype=np.float32))
    at = env.unwrapped.scenario.column("driver_steering")
    assert observation[at] == pytest.approx((car.wheelbase + (front - rear) * 25.0**2) / 400.0, rel=1e-5)
    assert abs(info["heading_error"]) < 0.05 and info["interventions"] == 0.0


def test_corrections_are_a_damped_swing_of_the_chosen_frequency() -> None:
    """A rolling car without lags: d' = v c, c' = v delta/l + l_r/l delta', delta = -l (w² d + 2 D w v c)/v²."""
    w, damping, v, step = 0.8, 0.5, 20.0, 0.01
    driver = {**NOBODY, "frequency": w, "damping": damping}
    vehicle = {"base": "yin", "steering": {"lag": 0.0, "rate_limit": None, "angle_limit": None}}
    road = {"dynamics": "kinematic", "road": "straight", "speed": v, "control_step": step}
    env = gym.make("lanekeep/LaneSupport-v0", driver=driver, vehicle=vehicle, **road)
    env.reset(seed=0, options={"lateral_error": 0.1, "heading_error": 0.0})
    errors = [env.step(np.zeros(2, dtype=np.float32))[4]["lateral_error"] for _ in range(600)]
    arm = VEHICLES["yin"].cg_to_rear_axle / v
    mass = 1.0 + 2.0 * damping * w * arm
    matrix = np.array([[0.0, 1.0], [-(w**2) / mass, -(2.0 * damping * w + w**2 * arm) / mass]])
    start = np.array([0.1, -arm * w**2 * 0.1 / mass])  # the first turn of the wheel turns the course at once
    swing = [(expm(matrix * step * k) @ start)[0] for k in range(1, 601)]
    assert np.abs(np.array(errors) - swing).max() < 0.002  # angles are held for a step


def test_what_the_actuator_is_told_is_the_mix() -> None:
    env = vector(driver="drowsy")
    observation, _ = env.reset(seed=3)
    rng, driver, told = np.random.default_rng(0), column(env, "driver_steering"), column(env, "steering_command")
    for _ in range(30):
        action = rng.uniform(-1.2, 1.2, (64, 2)).astype(np.float32)
        asked, share = np.clip(action[:, 0], -1.0, 1.0) * 0.15, np.clip(action[:, 1], 0.0, 1.0)
        before = observation[:, driver]
        observation, _, _, _, info = env.step(action)
        np.testing.assert_allclose(observation[:, told], before + share * (asked - before), atol=1e-6)
        np.testing.assert_allclose(info["assistance"], share * (asked - before), atol=1e-6)
        np.testing.assert_allclose(info["authority"], share, atol=1e-7)


def test_interventions_and_jumps_are_counted_as_a_trace_shows_them() -> None:
    env = vector(cars=16, driver="attentive")
    env.reset(seed=4)
    rng = np.random.default_rng(1)
    shares, added = [np.zeros(16)], [np.zeros(16)]
    for _ in range(60):
        share = rng.uniform(0.0, 1.0, 16) * (rng.random(16) < 0.6)
        _, _, _, _, info = env.step(np.stack([rng.uniform(-0.1, 0.1, 16), share], axis=1).astype(np.float32))
        shares.append(np.array(info["authority"])), added.append(np.array(info["assistance"]))
    shares, added = np.array(shares), np.array(added)
    begun = ((shares[1:] > 0.0) & (shares[:-1] == 0.0)).sum(axis=0)
    np.testing.assert_array_equal(info["interventions"], begun)
    jumps = np.where(shares[1:] != shares[:-1], np.abs(np.diff(added, axis=0)), 0.0).max(axis=0)
    np.testing.assert_allclose(info["handover_jump"], jumps, atol=1e-12)


def test_reward_is_the_price_of_assistance() -> None:
    env = gym.make("lanekeep/LaneSupport-v0", driver="attentive", reference_assistance=0.05, cost_weight=2.0)
    env.reset(seed=0, options={"lateral_error": 0.0})
    for action in ([0.0, 0.0], [0.02, 1.0], [0.1, 0.5]):
        _, reward, _, _, info = env.step(np.array(action, dtype=np.float32))
        assert reward == pytest.approx(-0.05 * min(16.0, 2.0 * (info["assistance"] / 0.05) ** 2), abs=1e-9)


@pytest.mark.parametrize(("driver", "most"), [("attentive", 0.0), ("drowsy", 1.0)])
def test_who_looks_away_holds_the_wheel_for_as_long_as_it_says(driver, most) -> None:
    """Lapses begin as often as the rate says, last from the shortest to the longest, and the angle rests."""
    env = vector(cars=256, driver=driver, road="straight", speed=25.0, departure="off")
    observation, _ = env.reset(seed=5)
    angles = [observation[:, column(env, "driver_steering")]]
    for _ in range(1200):
        observation = env.step(np.zeros((256, 2), dtype=np.float32))[0]
        angles.append(observation[:, column(env, "driver_steering")])
    rests = (np.diff(np.array(angles), axis=0) == 0.0).T
    lengths = []
    for car in rests:
        edges = np.flatnonzero(np.diff(np.concatenate([[False], car, [False]]).astype(int)))
        lengths += [
            int(b - a) for a, b in zip(edges[::2], edges[1::2], strict=True) if a > 0 and b < len(car) and b - a > 2
        ]
    if most == 0.0:
        assert not lengths
        return
    record: Driver = env.scenario.driver
    seconds = 0.05 * np.array(lengths)
    assert seconds.min() >= record.shortest_lapse - 0.05 and seconds.mean() == pytest.approx(2.5, abs=0.1)
    # Two in a row, one step apart or none, are few: the rate is of a second of looking.
    looked = 256 * 60.0 - seconds.sum()
    assert len(lengths) / looked == pytest.approx(record.lapse_rate, rel=0.15)


def test_the_drivers_aim_wanders_as_far_as_it_says() -> None:
    """An attentive driver on a straight: the standard deviation of the error is about that of the aim."""
    env = vector(
        cars=256, driver={"lapse_rate": 0.0, "wander_time": 20.0}, road="straight", speed=25.0, departure="off"
    )
    env.reset(seed=6)
    errors = [np.array(env.step(np.zeros((256, 2), dtype=np.float32))[4]["lateral_error"]) for _ in range(1200)]
    assert np.std(np.array(errors)[400:]) == pytest.approx(0.2, rel=0.12)


def test_car_i_is_the_single_environment_of_seed_s_plus_i() -> None:
    env = vector(cars=3)
    env.reset(seed=11)
    singles = [gym.make("lanekeep/LaneSupport-v0", departure="cost") for _ in range(3)]
    for i, single in enumerate(singles):
        single.reset(seed=11 + i)
    rng = np.random.default_rng(2)
    for _ in range(200):
        action = rng.uniform(-0.2, 0.2, (3, 2)).astype(np.float32)
        observation = env.step(action)[0]
        for i, single in enumerate(singles):
            np.testing.assert_array_equal(single.step(action[i])[0], observation[i])


def test_a_mapping_changes_the_named_driver_or_the_drowsy_one() -> None:
    drivers = [
        LaneSupportScenario.from_keywords(driver=driver).driver
        for driver in ({"lag": 0.3}, {"base": "drowsy", "lag": 0.3}, {"base": "attentive", "lag": 0.3})
    ]
    assert drivers[0] == drivers[1] == dataclasses.replace(DRIVERS["drowsy"], lag=0.3)
    assert drivers[2] == dataclasses.replace(DRIVERS["attentive"], lag=0.3)


def test_the_driver_asks_for_no_more_than_the_largest_angle() -> None:
    """A circle of 60 m takes a wheelbase of 2.5 m or more atan(2.5 / 60) = 0.042 rad; the actuator is told 0.02."""
    keywords = {"road": {"kind": "circle", "radius": 60.0}, "max_steering_angle": 0.02, "departure": "off"}
    env = gym.make("lanekeep/LaneSupport-v0", **keywords)
    env.reset(seed=0)
    column = env.unwrapped.scenario.column("steering_command")
    for _ in range(20):
        observation, *_ = env.step(np.zeros(2, dtype=np.float32))
    asked = observation[env.unwrapped.scenario.column("driver_steering")]
    assert asked > 0.03 and observation[column] == np.float32(0.02)


def test_wrong_drivers_and_actions_are_refused_in_one_line() -> None:
    for keywords, said in (
        ({"driver": "sleepy"}, ["driver", "drowsy"]),
        ({"driver": {"lapses": 1.0}}, ["driver", "lapse_rate"]),
        ({"driver": {"longest_lapse": 0.5}}, ["driver.shortest_lapse=1.0", "driver.longest_lapse=0.5", "<="]),
        ({"driver": {"shortest_lapse": 5.0}}, ["driver.shortest_lapse=5.0", "driver.longest_lapse=4.0", "<="]),
        ({"driver": {"base": "atentive"}}, ["driver.base='atentive'", "did you mean 'attentive'", "drowsy"]),
        ({"driver": {"base": "attentive", "lagg": 0.1}}, ["driver has no field 'lagg'", "'lag'"]),
        ({"action": "steering_rate"}, ["action", "steering_angle"]),
        ({"lane_width": 1.5}, ["lane_width", "1.8"]),
        ({"driver": {"wander": 0.0, "wander_time": 9.0}}, ["driver.wander_time", "does not wander"]),
    ):
        with pytest.raises((ValueError, TypeError)) as caught:
            LaneSupportScenario.from_keywords(**keywords)
        text = str(caught.value)
        assert "\n" not in text and all(word in text for word in said), text
