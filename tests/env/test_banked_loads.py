"""Load transfer where forces from outside push the car: it is what the tyres' forces make of it, not acceleration."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest
from axle_load_oracle import STATE, LoadedAxles, off

from lanekeep_env.physics.parameters import AIR_DENSITY, GRAVITY
from lanekeep_env.physics.tyres import MAGIC_FORMULA_SHAPE


def test_on_a_bank_a_car_that_drives_straight_on_leans_on_its_lower_wheels() -> None:
    """The rear slip is that of a tyre law whose stiffness falls with the load that g sin(bank) moves, a_y = 0."""
    bank, height, track, sensitivity, friction = 0.1, 3.0, 1.5, 0.3, 2.0
    vehicle = {
        "cg_height": height,
        "track_width": track,
        "front_roll_stiffness": 0.5,
        "friction_load_sensitivity": 0.0,
        "stiffness_load_sensitivity": sensitivity,
    }
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        vehicle=vehicle,
        road="straight",
        speed=20.0,
        tyre="load_sensitive",
        friction=friction,
        bank=bank,
        observation="full",
        start_lateral_error=0.0,
        start_course_error=0.0,
    )
    scenario = env.unwrapped.scenario
    at = {channel.name: k for k, channel in enumerate(scenario.channels)}
    observation, _ = env.reset(seed=0)
    for _ in range(500):
        steer = -0.05 * observation[at["lateral_error"]] - 1.0 * observation[at["heading_error"]]
        observation, *_ = env.step(np.array([steer / scenario.max_steering_angle], np.float32))
    assert abs(observation[at["yaw_rate"]]) < 1e-4
    car = scenario.vehicle
    share = car.cg_to_front_axle / (car.cg_to_front_axle + car.cg_to_rear_axle)
    load = car.mass * GRAVITY * share
    lift = height * math.sin(bank) / (track * share)  # of half the moment m g sin(bank) h, over the wheel's load
    force, peak = load * math.sin(bank), friction * load

    def slip(stiffness: float) -> float:
        return math.tan(math.asin(force / peak) / MAGIC_FORMULA_SHAPE) / (stiffness / (MAGIC_FORMULA_SHAPE * peak))

    unmoved = slip(car.rear_cornering_stiffness)
    expected = slip(car.rear_cornering_stiffness * (1.0 - sensitivity * lift**2))
    assert expected > 1.03 * unmoved
    assert -observation[at["sideslip"]] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(("bank", "across", "holds"), [(0.0, 12.0, False), (-0.05, -10.0, False), (0.05, 8.0, True)])
def test_a_drive_in_which_all_come_together_is_that_of_an_independent_integration(
    bank: float, across: float, holds: bool
) -> None:
    """Load transfer with bank, wind, drag, and a car that becomes heavier, softer and more slippery on the way."""
    v, area, lever, step = 25.0, 6.0, 0.7, 0.01
    factors = {"mass": 1.25, "friction": 0.85, "front_cornering_stiffness": 0.8, "rear_cornering_stiffness": 0.9}
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        vehicle={"steering": {"lag": 0.0, "rate_limit": None}, "side_area": area, "wind_lever": lever},
        tyre="load_sensitive",
        **{"road": "straight", "speed": v, "control_step": step, "departure": "off", "observation": "full"},
        **{"bank": bank, "crosswind": across, "cornering_drag": holds, "changes": {**factors, "time": 1.0}},
    ).unwrapped
    columns = [[c.name for c in env.channels].index(name) for name in STATE]
    observation, _ = env.reset(seed=0, options={"lateral_error": 0.0})
    wind = across, AIR_DENSITY / 2 * area, lever
    oracle = LoadedAxles(env.scenario.vehicle, bank, wind, v if holds else None)
    seen, expected = [observation[columns]], [observation[columns].astype(float)]
    for k in range(200):
        if k == 100:
            oracle.mass, oracle.friction, oracle.front, oracle.rear = factors.values()
        action = np.float32([0.06 * math.sin(0.03 * k) / env.scenario.max_steering_angle])
        seen.append(env.step(action)[0][columns])
        expected.append(oracle.step(expected[-1], env.scenario.max_steering_angle * float(action[0]), step))
    assert np.abs(np.array(seen)[:, STATE.index("yaw_rate")]).max() * v > 4.0
    # The stiffness is that of a level road's loads, larger by 1 - cos(bank).
    assert (off(seen, expected) < 1e-3 + 2.0 * (1.0 - math.cos(bank))).all()
