"""Werling's lateral laws inside the differential equations of an independent car: promises and limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lanekeep_baselines.werling_lateral import (
    WerlingMeasured,
    curvature_ahead,
    dynamic_steering,
    kinematic_steering,
)
from lanekeep_baselines.werling_predictor import SteeringPath, advance_queue, predict, queue_of
from lanekeep_baselines.werling_tyres import WerlingCar, axle_force, front_slip
from lanekeep_env.physics.parameters import VehicleParameters

VEHICLE = VehicleParameters("annieway", 1950.0, 3200.0, 1.20, 1.51, 90e3, 120e3)
CAR = WerlingCar.of(VEHICLE)
LENGTH = CAR.wheelbase


def critically_damped(rate, start, slope, way):
    """Solution of y'' + 2 rate y' + rate² y = 0."""
    return (start + (slope + rate * start) * way) * np.exp(-rate * way)


def test_the_car_is_the_oracles(werling) -> None:
    assert (CAR.front_peak, CAR.rear_peak) == pytest.approx(werling.peaks(1.0))
    assert WerlingCar.of(VEHICLE, 0.3).rear_peak == pytest.approx(werling.peaks(0.3)[1])


@pytest.mark.parametrize("friction", [0.1, 0.3, 1.0, 1.5])
def test_the_inverse_meets_the_force_and_stays_below_the_peak(friction: float) -> None:
    random = np.random.default_rng(1)
    car = WerlingCar.of(VEHICLE, friction)
    eta, force = random.uniform(-1.5, 1.5, 2000), random.uniform(-1.3, 1.3, 2000) * car.front_peak
    slip, limited = front_slip(force, eta, car.front_stiffness, car.front_peak)
    given = axle_force(slip, car.front_stiffness, car.front_peak)
    assert np.abs(given * np.cos(slip - eta) - force)[~limited].max() < 1e-12 * car.front_peak
    assert np.abs(given).max() <= 0.95 * car.front_peak * (1.0 + 1e-12)
    assert 0.2 < limited.mean() < 0.8
    # Less slip than given is less force: the range is monotone.
    for part in np.linspace(0.0, 1.0, 11):
        less = part * slip
        across = axle_force(less, car.front_stiffness, car.front_peak) * np.cos(less - eta)
        inside = ~limited & (np.abs(slip - eta) < 1.0) & (np.abs(eta) < 1.0)
        assert (np.sign(slip) * (force - across) >= -1e-9 * car.front_peak)[inside].all()


def test_dynamic_law_is_linear_on_circles(werling) -> None:
    """In world coordinates, 5 to 35 m/s, circles to either side that ask for 2 m/s², from 0.8 m and up to 0.2 rad."""
    v = np.repeat([5.0, 10.0, 15.3, 25.0, 35.0], 2)
    kappa = np.where(np.arange(10) % 2 == 0, 1.0, -1.0) * 2.0 / v**2
    omega, d0, course0 = 1.2, 0.8, -np.arcsin(1.0 / v)

    def errors(z):
        x, y, psi = z[:3]
        side = np.sign(kappa)
        across = 1.0 / kappa - y
        d = 1.0 / kappa - side * np.hypot(x, across)
        return d, psi - np.arctan2(side * x, side * across)

    def rates(_, flat):
        z = flat.reshape(5, 10)
        d, heading = errors(z)
        steer, limited = dynamic_steering(CAR, omega, WerlingMeasured(d, heading, z[3], z[4], v), kappa)
        assert not limited.any()
        return np.concatenate(werling.world_rates(*z, steer, v))

    start = np.stack([np.zeros(10), np.full(10, d0), course0, np.zeros(10), np.zeros(10)])
    times = np.linspace(0.0, 5.0, 26)
    found = solve_ivp(rates, (0.0, 5.0), start.ravel(), method="DOP853", t_eval=times, rtol=1e-10, atol=1e-11)
    d = np.array([errors(z.reshape(5, 10))[0] for z in found.y.T])
    wanted = critically_damped(omega, d0, v * np.sin(course0), times[:, None])
    assert np.abs(d - wanted).max() < 1e-6


def test_dynamic_law_is_linear_where_curvature_changes(werling) -> None:
    """In path coordinates, curvature in zigzag up to 2 m/s²: it need be continuous only, as the source claims."""
    v, omega = np.array([5.0, 15.3, 25.0, 35.0]), 1.0

    def rates(_, flat):
        s, d, heading, beta, r = flat.reshape(5, 4)
        kappa, course = 2.0 / v**2 * (2.0 / np.pi) * np.arcsin(np.sin(1.5 * s / v)), heading + beta
        steer, limited = dynamic_steering(CAR, omega, WerlingMeasured(d, heading, beta, r, v), kappa)
        assert not limited.any()
        beta_rate, r_rate, _ = werling.body_rates(beta, r, steer, v)
        along = v * np.cos(course) / (1.0 - d * kappa)
        return np.concatenate([along, v * np.sin(course), r - kappa * along, beta_rate, r_rate])

    start = np.concatenate([np.zeros(4), np.full(4, -0.8), np.arcsin(0.5 / v), np.zeros(8)])
    found = solve_ivp(rates, (0.0, 6.0), start, method="DOP853", rtol=1e-10, atol=1e-11, max_step=0.05)
    d = found.y.reshape(5, 4, -1)[1]
    assert np.abs(d - critically_damped(omega, -0.8, 0.5, found.t)).max() < 1e-6


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_kinematic_law_is_linear_over_the_way(direction: float) -> None:
    """With changing speed, curvature that changes with s, and large angles; the rows start differently."""
    k, d0, heading0 = 0.7, np.array([1.0, -0.8, 0.3, 0.0]), np.array([0.3, -0.9, 0.0, 0.8])

    def rates(t, flat):
        s, d, theta, _ = flat.reshape(4, 4)
        v = direction * (1.2 + np.sin(3.0 * t))
        kappa = 0.15 * np.sin(0.4 * s)
        steer = kinematic_steering(LENGTH, k, d, theta, np.full(4, direction), kappa)
        along = v * np.cos(theta) / (1.0 - d * kappa)
        return np.concatenate(
            [along, v * np.sin(theta), v / LENGTH * np.tan(steer) - kappa * along, np.full(4, abs(v))]
        )

    start = np.concatenate([np.zeros(4), d0, heading0, np.zeros(4)])
    found = solve_ivp(rates, (0.0, 10.0), start, method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.05)
    _, d, _, way = found.y.reshape(4, 4, -1)
    wanted = critically_damped(k, d0[:, None], direction * np.sin(heading0)[:, None], way)
    assert np.abs(d - wanted).max() < 1e-6


@pytest.mark.parametrize("v", [10.0, 25.0, 35.0])
def test_zero_dynamics(werling, v: float) -> None:
    """beta'' + (l_r/v) w0² beta' + w0² beta = 0 with w0² = l C_r/J, beside the two designed poles."""
    one = np.ones(1)

    def law(x):
        at = WerlingMeasured(*(number * one for number in (*x[:4], v)))
        return dynamic_steering(CAR, 1.0, at, 0.0 * one)[0][0]

    car = werling.linear_car(v)
    loop = car[:, :4] + np.outer(car[:, 4], werling.gradient(law, 4))
    coefficients = np.poly(loop)
    square = LENGTH * 120e3 / 3200.0
    wanted = np.polymul([1.0, 2.0, 1.0], [1.0, 1.51 / v * square, square])
    assert coefficients == pytest.approx(wanted, rel=0.01)
    swaying = max(np.linalg.eigvals(loop), key=abs)
    if abs(swaying.imag) > 0.0:
        assert -swaying.real / abs(swaying) == pytest.approx(1.51 * np.sqrt(square) / (2.0 * v), rel=0.01)


def sampled_law(omega: float, v: float, delay: float, predicting: bool):
    path = SteeringPath(0.05, delay, 0.02)

    def law(x):
        at = WerlingMeasured(*(np.array([z]) for z in (*x[:4], v)))
        if predicting:
            at, _ = predict(CAR, path, at, x[4:5], x[None, 5:], np.zeros((1, path.queued)))
        return dynamic_steering(CAR, omega, at, np.zeros(1))[0][0]

    return law


@pytest.mark.parametrize(
    ("v", "delay", "limit"),
    [
        (10, 0.0, 28.0),
        (15.3, 0.0, 25.0),
        (25, 0.0, 22.0),
        (35, 0.0, 1.95),
        (10, 0.1, 4.0),
        (15.3, 0.1, 2.3),
        (25, 0.1, 0.3),
    ],
)
def test_bandwidth_limits(werling, v: float, delay: float, limit: float) -> None:
    """50 Hz and a lag of 50 ms: where the loop first becomes unstable."""
    omegas = limit * np.arange(0.1, 2.0, 0.1)
    radii = [werling.spectral_radius(sampled_law(w, v, delay, False), v, delay) for w in omegas]
    first = int(np.argmax(np.array(radii) >= 1.0))
    assert first > 0 and radii[first] >= 1.0
    found = brentq(
        lambda w: werling.spectral_radius(sampled_law(w, v, delay, False), v, delay) - 1.0,
        *omegas[first - 1 : first + 1],
    )
    assert found == pytest.approx(limit, rel=0.15)


def test_delay_at_speed_needs_the_predictor(werling) -> None:
    """100 ms more: at 35 m/s no omega is stable, at 25 m/s none that is of use; with the predictor all up to 1.5."""
    for omega in (0.1, 0.3, 0.5, 1.0, 1.5):
        assert werling.spectral_radius(sampled_law(omega, 35.0, 0.1, False), 35.0, 0.1) > 1.0
        for v in (20.0, 25.0, 30.0, 35.0):
            assert werling.spectral_radius(sampled_law(omega, v, 0.1, True), v, 0.1) < 1.0
    assert werling.spectral_radius(sampled_law(1.0, 25.0, 0.1, False), 25.0, 0.1) > 1.0


@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_predictor_goes_where_the_car_goes(werling, lag: float) -> None:
    """In a curve at 3 m/s², large sideslip; against a tight solution of the world's car."""
    v, kappa, step, commands = 20.0, 0.0075, 0.02, np.array([0.05, 0.08, 0.02, -0.03, 0.04])

    def rates(t, z):
        command = commands[min(int(t / step), 4)]
        steer = command if lag == 0.0 else z[5]
        return [*werling.world_rates(*z[:5], steer, v), 0.0 if lag == 0.0 else (command - steer) / lag]

    z = np.array([0.0, 0.3, 0.05, -0.02, 0.2, 0.03])
    for i in range(5):
        times = (i * step + 1e-12, (i + 1) * step - 1e-12)
        z = solve_ivp(rates, times, z, rtol=1e-11, atol=1e-12, max_step=step / 4).y[:, -1]
    across = 1.0 / kappa - z[1]
    truth = 1.0 / kappa - np.hypot(z[0], across), z[2] - np.arctan2(z[0], across), z[3], z[4]
    at = WerlingMeasured(*(np.array([x]) for x in (0.3, 0.05, -0.02, 0.2, v)))
    path = SteeringPath(lag, 0.1, step)
    assert path.queued == 5
    found, steer = predict(CAR, path, at, np.array([0.03]), commands[None], np.full((1, 5), kappa))
    assert np.array(found[:4])[:, 0] == pytest.approx(truth, abs=1e-5)
    assert steer[0] == pytest.approx(z[5] if lag else commands[-1], abs=1e-9)


def test_queue_of_commands() -> None:
    queue = queue_of(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([True, False]), np.array([0.5, 0.6]))
    assert queue.tolist() == [[0.5, 0.5], [3.0, 4.0]]
    assert advance_queue(queue, np.array([7.0, 8.0])).tolist() == [[0.5, 7.0], [4.0, 8.0]]


def test_near_the_centre_of_curvature_and_across_the_path_steering_is_bounded() -> None:
    d, course = (x.ravel() for x in np.meshgrid(np.linspace(-30.0, 30.0, 61), np.linspace(-np.pi, np.pi, 61)))
    zero, v = np.zeros_like(d), np.full_like(d, 10.0)
    steer, limited = dynamic_steering(CAR, 1.0, WerlingMeasured(d, course, zero, zero, v), np.full_like(d, 0.05))
    assert np.isfinite(steer).all() and np.abs(steer).max() < 0.25 and limited.any()
    slow = kinematic_steering(LENGTH, 1.0, d, course, np.ones_like(d), np.full_like(d, 0.05))
    assert np.isfinite(slow).all() and np.abs(slow).max() < 0.5 * np.pi


def test_curvature_ahead() -> None:
    samples = np.array([[0.0, 1.0, 4.0], [2.0, 2.0, 0.0]])
    assert curvature_ahead(samples, 0.5, np.array([0.25, 0.75])).tolist() == [0.5, 1.0]
    assert curvature_ahead(samples, 0.5, np.array([9.0, 0.0])).tolist() == [4.0, 2.0]
    assert curvature_ahead(samples[:, :1], 0.5, np.array([9.0, 0.0])).tolist() == [0.0, 2.0]
