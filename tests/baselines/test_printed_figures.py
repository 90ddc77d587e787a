"""Yin 2010's printed gains and the figures of the lateral control that were worked out elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.yin_design import YinModel, control_gains, observer_gains, printed_weights
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import LaneKeepScenario

# The slides' last page.
PRINTED_CONTROL = np.array([0.2994, 2.0638, -13.5262, -0.5271])
PRINTED_OBSERVER = np.array(
    [
        [0.0051, -0.0049, -0.0593],
        [0.0020, -0.0018, -0.0216],
        [-0.0018, 0.0061, 0.0844],
        [-0.0216, 0.0844, 2.0538],
        [0.0051, -0.0049, -0.0593],
    ]
)
# The decoded car, its stiffnesses to one digit more: b2 = 1.8612 1/s² and a22/v = -5.1374 1/s at 25 m/s, inside the
# rounding of the decoded 1.861 and -5.137; with just those digits the yaw-rate gain would be 2.0639.
DECODED = replace(VEHICLES["yin"], front_cornering_stiffness=61850.0, rear_cornering_stiffness=107665.0)


def test_coefficients_of_the_decoded_car() -> None:
    model = YinModel.of(VEHICLES["yin"])
    assert model.a11 == pytest.approx(-99.7, abs=0.05)
    assert model.a12 == pytest.approx(47.7, abs=0.05)
    assert model.a21 == pytest.approx(30.0, abs=0.05)
    assert model.a22 == pytest.approx(-128.4, abs=0.05)
    assert model.b1 == pytest.approx(2.274, abs=5e-4)
    assert model.b2 == pytest.approx(1.861, abs=5e-4)
    assert model.actuator_rate == pytest.approx(11.16)
    refined = YinModel.of(DECODED)
    assert refined.b2 == pytest.approx(1.861, abs=5e-4) and refined.a22 / 25.0 == pytest.approx(-5.137, abs=5e-4)


def test_every_printed_digit_comes_back() -> None:
    model = YinModel.of(DECODED)
    np.testing.assert_array_equal(control_gains(model, 25.0).round(4), PRINTED_CONTROL)
    np.testing.assert_array_equal(observer_gains(model, 25.0, printed_weights).round(4), PRINTED_OBSERVER)


def test_the_shipped_car_gives_the_printed_gains_to_a_few_parts_in_ten_thousand() -> None:
    model = YinModel.of(VEHICLES["yin"])
    np.testing.assert_allclose(control_gains(model, 25.0), PRINTED_CONTROL, rtol=3e-4)
    np.testing.assert_allclose(observer_gains(model, 25.0, printed_weights), PRINTED_OBSERVER, atol=1e-4)


def test_weights_as_decoded_give_the_printed_observer_within_one_last_digit() -> None:
    def decoded(speed: float) -> tuple[np.ndarray, np.ndarray]:
        return np.diag([0.0143, 0.00203, 0.00355, 0.00558, 0.00357]), np.eye(3)

    gains = observer_gains(YinModel.of(DECODED), 25.0, decoded)
    np.testing.assert_allclose(gains.round(4), PRINTED_OBSERVER, atol=1.01e-4)
    assert (gains.round(4) == PRINTED_OBSERVER).sum() >= 13


@pytest.mark.parametrize(("name", "error"), [("yin-lqr", 0.804), ("yin-lqr-observer-printed", 0.413)])
def test_steady_errors_on_the_reduced_plant(bench, name: str, error: float) -> None:
    scenario = LaneKeepScenario(vehicle=DECODED)
    car = bench.LinearCar(DECODED, 25.0, scenario.control_step, sideslip=False)
    states = bench.drive(lanekeep_baselines.make(name, scenario), scenario, car, lambda t: np.array([0.003]), 60.0)
    assert abs(states[-1, 0, 4]) == pytest.approx(error, abs=5e-4)


def test_steady_errors_by_hand_from_the_printed_digits() -> None:
    """u = delta in the steady state; r = v kappa; the observer sees theta_d' = -r, so its innovation is v kappa off."""
    speed, kappa, b2, a22 = 25.0, 0.003, 1.861, -5.137
    yaw_rate = speed * kappa
    wheel = -a22 / b2 * yaw_rate
    k = PRINTED_CONTROL
    lqr = (wheel * (1.0 + k[0]) + k[1] * yaw_rate) / -k[3]
    # Observer in steady state: 0 = A_o x + B_o u + k_o e, with e = y - C x and u = wheel; unknown x (5), y_d.
    a = np.zeros((5, 5))
    a[0, 0], a[0, 4], a[1, 0], a[1, 1], a[2, 1], a[3, 2] = -11.16, 11.16, b2, a22, -1.0, speed
    c = np.eye(5)[1:4]
    system = np.zeros((6, 6))
    system[:5, :5] = a - PRINTED_OBSERVER @ c
    system[:5, 5] = PRINTED_OBSERVER[:, 2]
    system[5, 4], system[5, 5] = 1.0, k[3]  # u = -k x - delta_s
    right = np.append(-PRINTED_OBSERVER[:, 0] * yaw_rate, -wheel * (1.0 + k[0]) - k[1] * yaw_rate)
    right[0] -= 11.16 * wheel
    printed = np.linalg.solve(system, right)[5]
    assert lqr == pytest.approx(0.804, abs=5e-4)
    assert printed == pytest.approx(0.413, abs=5e-4)


SINE_ROADS = {
    "yin-lqr": (2.32, 2.41, 2.43, 2.24),
    "yin-lqr-observer-printed": (2.16, 1.58, 1.22, 1.17),
    "yin-lqr-observer": (0.30, 0.18, 0.14, 0.14),
}


@pytest.mark.parametrize("control_step", [0.01, 0.05])
@pytest.mark.parametrize("name", SINE_ROADS)
def test_sine_roads_on_the_full_car(bench, name: str, control_step: float) -> None:
    """The table is for 10 ms; that the suite's 50 ms give the same figures says that the discretisation is right."""
    speed, wavelengths = 18.97, np.array([400.0, 800.0, 1600.0, 3200.0])
    scenario = LaneKeepScenario(control_step=control_step)
    car = bench.LinearCar(scenario.vehicle, speed, control_step)

    def curvature(t: float) -> np.ndarray:
        return 0.0109 * np.sin(2.0 * np.pi * speed * t / wavelengths)

    states = bench.drive(lanekeep_baselines.make(name, scenario), scenario, car, curvature, 40.0, start=1.0)
    lateral = states[round(5.0 / control_step) :, :, 4]
    np.testing.assert_allclose(np.sqrt(np.mean(lateral**2, axis=0)), SINE_ROADS[name], rtol=0.05)
    if name == "yin-lqr":
        assert np.abs(lateral[:, 0]).max() == pytest.approx(3.15, rel=0.01)


@pytest.mark.parametrize("name", lanekeep_baselines.names(LaneKeepScenario(preview=1)))
def test_scenario_a_ends_with_no_remaining_error(bench, name: str) -> None:
    """Straight road, 60 km/h, 1.5 m off."""
    scenario = LaneKeepScenario(preview=1)
    car = bench.LinearCar(scenario.vehicle, 60.0 / 3.6, scenario.control_step)
    states = bench.drive(lanekeep_baselines.make(name, scenario), scenario, car, lambda t: np.zeros(1), 40.0, start=1.5)
    assert np.abs(states[-100:, 0, 3:]).max() < 1e-3
    assert states[:, 0, 4].min() > -0.5  # and it hardly swings over on the way


def test_weights_of_every_design_speed_are_those_that_are_asked_for() -> None:
    """Q(v_i), as the slides have it: ten times the weight of y_d is the gain's root of ten on y_d."""

    def heavier(speed: float) -> tuple[np.ndarray, np.ndarray]:
        return np.diag([0.0, 0.0, 34.04, 0.27784 * speed]), np.eye(1)

    model = YinModel.of(VEHICLES["yin"])
    for speed in (15.0, 25.0, 50.0):
        # The last entry of k_c's Riccati equation: k_4² = q_4.
        assert control_gains(model, speed, heavier)[3] == pytest.approx(-np.sqrt(0.27784 * speed), rel=1e-6)
        assert control_gains(model, speed)[3] == pytest.approx(-np.sqrt(0.27784), rel=1e-6)
