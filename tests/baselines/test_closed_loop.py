"""Loops of every controller and every car: stable at all speeds, exact where they say so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lanekeep_baselines
from lanekeep_baselines.yin_design import STEERING_RATIO, YinModel, observer_gains, redesigned_weights
from lanekeep_baselines.yin_observer import transition
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import CameraLaneScenario, LaneKeepScenario, RoadScenario

#: Largest speed, m/s; the van's steering motor, with a lag of 0.25 s, is made for walking speed.
FASTEST = {"van": 15.0}
#: Cars for roads; the 1:10 ones are made for walls, at 2 m/s.
CARS = [name for name, car in VEHICLES.items() if car.mass > 100.0]


@pytest.mark.parametrize("vehicle", CARS)
@pytest.mark.parametrize("name", lanekeep_baselines.names(LaneKeepScenario(preview=11)))
def test_stable_with_sideslip_at_design_speeds_and_between(bench, name: str, vehicle: str) -> None:
    scenario = LaneKeepScenario(vehicle=VEHICLES[vehicle], preview=11)
    policy = lanekeep_baselines.make(name, scenario)
    for speed in [0.5, 1.0, 2.0, *np.arange(5.0, FASTEST.get(vehicle, 60.0) + 0.1, 1.25)]:
        car = bench.LinearCar(scenario.vehicle, speed, scenario.control_step)
        poles = np.linalg.eigvals(bench.closed_loop(policy, scenario, car)).astype(complex)
        assert np.abs(poles).max() < 1.0, f"{speed} m/s"
        if speed <= 50.0:
            rates = np.log(poles[np.abs(poles) > 1e-6])
            assert np.min(-rates.real / np.abs(rates)) > 0.1, f"damping at {speed} m/s"


@pytest.mark.parametrize("vehicle", CARS)
@pytest.mark.parametrize("name", lanekeep_baselines.names(LaneKeepScenario(preview=11)))
def test_stable_and_exact_without_slip(bench, name: str, vehicle: str) -> None:
    scenario = LaneKeepScenario(vehicle=VEHICLES[vehicle], dynamics="kinematic", preview=11)
    policy = lanekeep_baselines.make(name, scenario)
    for speed in [1.0, 2.0, *np.arange(5.0, FASTEST.get(vehicle, 50.0) + 0.1, 2.5)]:
        car = bench.KinematicCar(scenario.vehicle, speed, scenario.control_step)
        assert np.abs(np.linalg.eigvals(bench.closed_loop(policy, scenario, car))).max() < 1.0, f"{speed} m/s"
    if name == "yin-lqr-feedforward":
        states = bench.drive(policy, scenario, car, lambda t: np.array([0.0015]), 30.0)
        assert abs(states[-1, 0, 4]) < 5e-3


@pytest.mark.parametrize("vehicle", CARS)
def test_feedforward_has_no_steady_error_in_a_curve(bench, vehicle: str) -> None:
    scenario = LaneKeepScenario(vehicle=VEHICLES[vehicle], preview=3)
    policy = lanekeep_baselines.make("yin-lqr-feedforward", scenario)
    for speed in (8.0, 18.97, 25.0, 37.5, 50.0):
        curvature = 3.9 / speed**2 * np.array([1.0, -0.5])
        car = bench.LinearCar(scenario.vehicle, speed, scenario.control_step)
        states = bench.drive(policy, scenario, car, lambda t, curvature=curvature: curvature, 40.0)
        assert np.abs(states[-1, :, 4]).max() < 1e-4
        # The heading points inwards by the sideslip: the course follows the road.
        np.testing.assert_allclose(states[-1, :, 3], -states[-1, :, 1], atol=1e-5)


def test_feedforward_asks_early_by_what_the_actuator_loses() -> None:
    """Yin's lag of 89.6 ms and half a control step make 114.6 ms: 15 % of the way from sample 1 to sample 2."""
    row = np.zeros((1, 9), dtype=np.float32)
    row[0, 3] = 20.0
    answers = {}
    for preview in (1, 2, 3):
        policy = lanekeep_baselines.make("yin-lqr-feedforward", LaneKeepScenario(preview=preview))
        for seen in range(preview):
            ahead = row[:, : 6 + preview].copy()
            ahead[0, 6 + seen] = 0.01
            answers[preview, seen] = float(policy.predict(ahead)[0][0, 0])
    part = (1.0 / 11.16 + 0.025) / 0.1 - 1.0
    assert answers[2, 1] / (answers[3, 1] + answers[3, 2]) == pytest.approx(1.0)
    assert answers[3, 2] / answers[2, 1] == pytest.approx(part, rel=1e-4)
    assert answers[1, 0] == pytest.approx(answers[2, 0] + answers[2, 1], rel=1e-5)


@pytest.mark.parametrize("speed", [0.0, 3.0, 18.97, 47.3])
@pytest.mark.parametrize("step", [0.01, 0.05, 0.1])
def test_observer_transition_is_exact(speed: float, step: float) -> None:
    """Against an independent integration, with the command held and the measurement running linearly."""
    model = YinModel.of(VEHICLES["yin"], STEERING_RATIO)
    gains = observer_gains(model, 30.0, redesigned_weights)
    x, y, following = np.array([0.1, -0.2, 0.03, 0.7, -0.05]), np.array([0.1, 0.02, -0.4]), np.array([0.2, 0.0, -0.5])
    a22 = model.a22 / max(speed, 1.0)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        wheel, r, theta, d, offset = x
        model_rate = [11.16 * (0.3 + offset - wheel), model.b2 * wheel + a22 * r, -r, speed * theta, 0.0]
        return np.array(model_rate) + gains @ (y + (following - y) * t / step - np.array([r, theta, d]))

    truth = solve_ivp(rate, (0.0, step), x, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(transition(model, speed, gains, step) @ [*x, *y, 0.3, *following], truth, atol=1e-8)


@pytest.mark.parametrize("scenario", [LaneKeepScenario(preview=1), CameraLaneScenario()], ids=["lane", "camera"])
def test_standstill_is_survived(scenario: RoadScenario) -> None:
    values = {
        "lateral_error": 0.5,
        "heading_error": 0.1,
        "edge_distance": 2.0,
        "speed": 0.0,
        "curvature_preview_0": 0.01,
    }
    for name in lanekeep_baselines.names(scenario):
        policy = lanekeep_baselines.make(name, scenario)
        state = None
        for step in range(200):
            values["edge_valid"] = float(step < 50 or step >= 100)
            observation = [values.get(channel.name, 0.0) for channel in scenario.channels]
            action, state = policy.predict(np.array(observation, dtype=np.float32), state)
            assert np.isfinite(action).all() and (state is None or np.isfinite(state).all())
