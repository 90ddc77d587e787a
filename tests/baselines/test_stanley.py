"""Stanley against its authors' closed form, geometry worked out elsewhere, and the environment."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lanekeep_baselines
import lanekeep_env  # noqa: F401  (registers the environments)
from lanekeep_baselines.stanley import Stanley
from lanekeep_env.physics.vehicles import VEHICLES, vehicle_from
from lanekeep_env.scenario import LaneKeepScenario

CAR = vehicle_from({"steering": {"lag": 0.0}})


class Bare(Stanley):
    """The law of 2006: no softening."""

    softening = 0.0


def steer(policy: Stanley, **channels: float) -> float:
    """Return the policy's continuous answer to one observation."""
    at = {name: np.array([value]) for name, value in {"yaw_rate": 0.0, **channels}.items()}
    return float(policy.wanted(at)[0])


def front_wheels(policy: Stanley, speed: float, start: tuple[float, float], times: np.ndarray) -> np.ndarray:
    """Drive a car without slip, its front wheels at ``speed``, along y = 0; return y of the front axle and heading."""

    def rates(_: float, state: np.ndarray) -> list[float]:
        y, heading = state
        lateral = y - CAR.cg_to_front_axle * np.sin(heading)
        delta = steer(policy, lateral_error=lateral, heading_error=heading, speed=speed)
        return [speed * np.sin(heading + delta), speed * np.sin(delta) / CAR.wheelbase]

    return solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-12).y


@pytest.mark.parametrize("speed", [2.0, 10.0, 30.0])
@pytest.mark.parametrize("start", [(1.5, 0.0), (-8.0, 0.3), (4.0, -0.6)])
def test_error_of_the_front_axle_follows_the_closed_form(speed: float, start: tuple[float, float]) -> None:
    """e' = -k e / sqrt(1 + (k e/v)²), so that w = k e/v keeps sqrt(1 + w²) - artanh(1/sqrt(1 + w²)) + k t constant."""
    policy = Bare(LaneKeepScenario(vehicle=CAR, dynamics="kinematic"))
    times = np.linspace(0.0, 3.0, 31)
    error, _ = front_wheels(policy, speed, start, times)
    root = np.sqrt(1.0 + (policy.gain * error / speed) ** 2)
    constant = root - np.arctanh(1.0 / root) + policy.gain * times
    np.testing.assert_allclose(constant, constant[0], atol=1e-5)
    assert (np.sign(error) == np.sign(start[0])).all() and (np.diff(np.abs(error)) < 0.0).all()


def test_small_errors_decay_exponentially_and_with_softening_more_slowly() -> None:
    times = np.linspace(0.0, 2.0, 21)
    scenario = LaneKeepScenario(vehicle=CAR, dynamics="kinematic")
    error, heading = front_wheels(Bare(scenario), 20.0, (0.01, 0.0), times)
    np.testing.assert_allclose(error, 0.01 * np.exp(-2.0 * times), rtol=1e-6)
    softened, _ = front_wheels(Stanley(scenario), 20.0, (0.01, 0.0), times)
    np.testing.assert_allclose(softened, 0.01 * np.exp(-2.0 * 20.0 / 21.0 * times), rtol=1e-6)
    assert abs(heading[-1]) < abs(error[-1])


@pytest.mark.parametrize("radius", [8.0, -25.0, 400.0])
def test_front_axle_is_converted_exactly_on_a_circle(radius: float) -> None:
    """Against the front axle's place in the plane: distance from the circle's centre and the tangent there."""
    policy = Stanley(LaneKeepScenario(preview=1))
    random = np.random.default_rng(0)
    lateral, heading = random.uniform(-2.0, 2.0, 50), random.uniform(-0.6, 0.6, 50)
    got_lateral, got_heading = policy.front_axle(lateral, heading, np.full(50, 1.0 / radius))
    front = np.array([1.3 * np.cos(heading), lateral + 1.3 * np.sin(heading) - radius])  # from the centre
    side = np.sign(radius)
    np.testing.assert_allclose(got_lateral, side * (abs(radius) - np.hypot(*front)), atol=1e-12)
    tangent = np.arctan2(side * front[0], -side * front[1])
    np.testing.assert_allclose(got_heading, heading - tangent, atol=1e-12)


def test_no_steady_error_on_a_circle_without_slip() -> None:
    """The kinematic car of the plane, driven round a circle of 30 m by its rear axle's bicycle equations."""
    policy = Stanley(LaneKeepScenario(vehicle=CAR, dynamics="kinematic", preview=1))
    radius, speed = 30.0, 8.0

    def rates(_: float, state: np.ndarray) -> list[float]:
        x, y, psi = state
        cg = np.array([x + 1.5 * np.cos(psi), y + 1.5 * np.sin(psi)])
        tangent = np.arctan2(cg[0], -cg[1])
        delta = steer(
            policy,
            lateral_error=radius - np.hypot(*cg),
            heading_error=(psi - tangent + np.pi) % (2 * np.pi) - np.pi,
            speed=speed,
            curvature_preview_0=1.0 / radius,
        )
        return [speed * np.cos(psi), speed * np.sin(psi), speed * np.tan(delta) / CAR.wheelbase]

    x, y, psi = solve_ivp(rates, (0.0, 15.0), (-1.5, -31.0, 0.0), rtol=1e-9, atol=1e-10).y[:, -1]
    front = np.hypot(x + CAR.wheelbase * np.cos(psi), y + CAR.wheelbase * np.sin(psi))
    assert front == pytest.approx(radius, abs=1e-6)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_no_steady_error_of_the_front_axle_with_slip(bench, vehicle: str) -> None:
    scenario = LaneKeepScenario(vehicle=VEHICLES[vehicle], preview=1)
    # The van's steering motor, with a lag of 0.25 s, is made for walking speed.
    for speed in (8.0, 25.0, 50.0) if vehicle != "van" else (8.0,):
        curvature = 3.9 / speed**2 * np.array([1.0, -0.5])
        car = bench.LinearCar(scenario.vehicle, speed, scenario.control_step)
        policy = lanekeep_baselines.make("stanley", scenario)
        states = bench.drive(policy, scenario, car, lambda t, curvature=curvature: curvature, 30.0)
        front = scenario.vehicle.cg_to_front_axle
        error = states[-1, :, 4] + front * states[-1, :, 3] - curvature * front**2 / 2
        # The linear car keeps small angles; at 8 m/s the circle of the law is 16 m wide.
        assert np.abs(error).max() < (1e-3 if speed > 20.0 else 0.02)


def test_yaw_damping_acts_on_the_yaw_rate_beyond_the_path_s_and_only_where_tyres_slip() -> None:
    channels = {"lateral_error": 0.1, "heading_error": 0.02, "speed": 20.0, "curvature_preview_0": 0.01}
    policy = lanekeep_baselines.make("stanley", LaneKeepScenario(preview=1))
    assert steer(policy, yaw_rate=0.3, **channels) - steer(policy, yaw_rate=0.2, **channels) == pytest.approx(-0.01)
    undamped = type("Undamped", (Stanley,), {"yaw_damping": 0.0})(LaneKeepScenario(preview=1))
    assert steer(undamped, yaw_rate=0.2, **channels) == pytest.approx(steer(policy, yaw_rate=0.2, **channels))
    kinematic = lanekeep_baselines.make("stanley", LaneKeepScenario(preview=1, dynamics="kinematic"))
    assert steer(kinematic, yaw_rate=0.3, **channels) == steer(kinematic, yaw_rate=0.2, **channels)


def test_damping_is_what_keeps_a_real_car_calm(bench) -> None:
    """Yin's car with its actuator at 50 m/s."""
    scenario = LaneKeepScenario()
    car = bench.LinearCar(scenario.vehicle, 50.0, scenario.control_step)
    dampings = []
    for policy in (Stanley(scenario), type("Undamped", (Stanley,), {"yaw_damping": 0.0})(scenario)):
        poles = np.linalg.eigvals(bench.closed_loop(policy, scenario, car)).astype(complex)
        rates = np.log(poles[np.abs(poles) > 1e-6])
        dampings.append(np.min(-rates.real / np.abs(rates)))
    np.testing.assert_allclose(dampings, [0.17, 0.05], atol=0.01)


def test_standstill_without_softening_is_no_nan() -> None:
    policy = Bare(LaneKeepScenario())
    assert steer(policy, lateral_error=0.0, heading_error=0.0, speed=0.0) == 0.0
    assert steer(policy, lateral_error=0.2, heading_error=0.0, speed=0.0) == pytest.approx(-np.pi / 2)


@pytest.mark.parametrize(("preview", "figures"), [(0, (0.69, 0.72, 0.73, 0.68)), (1, (0.02, 0.01, 0.01, 0.01))])
def test_sine_roads_of_the_readme(bench, preview: int, figures: tuple[float, ...]) -> None:
    scenario = LaneKeepScenario(preview=preview)
    speed, wavelengths = 18.97, np.array([400.0, 800.0, 1600.0, 3200.0])
    car = bench.LinearCar(scenario.vehicle, speed, scenario.control_step)

    def curvature(t: float) -> np.ndarray:
        return 0.0109 * np.sin(2.0 * np.pi * speed * t / wavelengths)

    states = bench.drive(lanekeep_baselines.make("stanley", scenario), scenario, car, curvature, 40.0, start=1.0)
    np.testing.assert_allclose(np.sqrt(np.mean(states[100:, :, 4] ** 2, axis=0)), figures, atol=0.005)


@pytest.mark.parametrize(
    "settings",
    [{}, {"road": "yin"}, {"vehicle": "commonroad-3"}, {"dynamics": "kinematic"}, {"action": "steering_rate"}],
    ids=str,
)
def test_no_departure_in_an_episode(settings: dict) -> None:
    envs = gym.make_vec("lanekeep/LaneKeep-v0", num_envs=16, preview=1, **settings)
    policy = lanekeep_baselines.make("stanley", envs.unwrapped.scenario)
    observation, _ = envs.reset(seed=0)
    for _ in range(600):
        observation, _, terminated, _, _ = envs.step(policy.predict(observation)[0])
        assert not terminated.any()
    envs.close()
