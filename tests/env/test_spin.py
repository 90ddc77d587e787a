"""Cars that spin on saturating tyres: no more lateral acceleration than friction gives, and the path of SciPy."""

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lanekeep_env  # noqa: F401

SPINS = [
    ("pses", 20.0, 0.15, {}),
    ("yin", 30.0, 0.1, {"rear_cornering_stiffness": 35_000.0}),
    ("yin", 25.0, 0.1, {"rear_cornering_stiffness": 45_000.0}),
]
STEP = 0.01


def spin(vehicle, v, angle, changes):
    """Hold a steering angle for 3 s; return the car and rows (heading, sideslip, lateral error), one each 10 ms."""
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        max_episode_steps=400,
        vehicle={
            "base": vehicle,
            **changes,
            "steering": {"lag": 0.0, "rate_limit": None, "angle_limit": None, "backlash": 0.0},
        },
        tyre="magic_formula",
        road="straight",
        speed=v,
        control_step=STEP,
        departure="off",
        max_steering_angle=angle,
        observation="full",
    )
    env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0, "arc_length": 0.0})
    names = [channel.name for channel in env.unwrapped.channels]
    columns = [names.index(name) for name in ("heading_error", "sideslip")]
    rows = []
    for _ in range(300):
        observation, *_, info = env.step(np.ones(1, np.float32))
        rows.append((*observation[columns].astype(float), info["lateral_error"]))
    return env.unwrapped.scenario.vehicle, np.array(rows)


def rates(car, v, angle):
    """W08 (1) and (3) on a straight; the slips' longitudinal part is held above a tenth of the speed."""
    load = 9.81 * car.mass / car.wheelbase
    ahead, behind = car.cg_to_front_axle, car.cg_to_rear_axle

    def tyre(slip, stiffness, peak):
        return peak * np.sin(1.5 * np.arctan(stiffness * slip / (1.5 * peak)))

    def rates_of(_, state):
        _, theta, beta, r = state
        across, along = v * np.sin(beta) + ahead * r, v * np.cos(beta)
        lateral = across * np.cos(angle) - along * np.sin(angle)
        forward = max(along * np.cos(angle) + across * np.sin(angle), 0.1 * v)
        front = tyre(-np.arctan(lateral / forward), car.front_cornering_stiffness, load * behind)
        slip = np.arctan((behind * r - v * np.sin(beta)) / max(along, 0.1 * v))
        rear = tyre(slip, car.rear_cornering_stiffness, load * ahead)
        turn = (front * np.cos(angle - beta) + rear * np.cos(beta)) / (car.mass * v)
        yaw = (front * ahead * np.cos(angle) - rear * behind) / car.yaw_inertia
        return [v * np.sin(theta + beta), r, turn - r, yaw]

    return rates_of


@pytest.mark.parametrize(("vehicle", "v", "angle", "changes"), SPINS)
def test_the_path_turns_no_faster_than_friction_lets_it(vehicle, v, angle, changes):
    _, rows = spin(vehicle, v, angle, changes)
    turn = np.diff(rows[:, 0] + rows[:, 1])
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    assert np.abs(turn * v / STEP).max() <= 9.81 * 1.001
    assert np.abs(rows[:, 1]).max() > 1.0  # it does spin


@pytest.mark.parametrize(("vehicle", "v", "angle", "changes"), SPINS)
def test_a_spin_is_that_of_the_equations(vehicle, v, angle, changes):
    car, rows = spin(vehicle, v, angle, changes)
    times = STEP * np.arange(1, 301)
    found = solve_ivp(rates(car, v, angle), (0.0, 3.0), np.zeros(4), t_eval=times, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(rows[:, 2], found.y[0], atol=0.05)
