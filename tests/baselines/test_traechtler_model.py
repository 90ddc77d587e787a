"""The linear model of the camera-guided van: exact in time, the linearisation of the van while its speed changes."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from lanekeep_baselines.traechtler_model import CameraModel

MODEL = CameraModel(wheelbase=3.0, look_ahead=3.5, lag=0.25)


def exact(model: CameraModel, start: list[float], command: float, curvature: float, v: float, h: float) -> np.ndarray:
    """Return (e, theta, delta) by the matrix exponential, the inputs as states that rest."""
    a = np.zeros((5, 5))
    a[0, 1], a[0, 2] = v, v * model.reach / model.wheelbase
    a[1, 2], a[1, 4] = v / model.wheelbase, -v
    a[2, 2], a[2, 3] = -1.0 / model.lag, 1.0 / model.lag
    return (expm(a * h) @ np.array([*start, command, curvature]))[:3]


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32), n=st.integers(1, 5))
def test_a_step_is_exact(seed: int, n: int) -> None:
    random = np.random.default_rng(seed)
    wheelbase, look_ahead, lag, h = random.uniform([1.0, 0.0, 0.02, 0.005], [6.0, 8.0, 1.0, 0.5])
    model = CameraModel(wheelbase, look_ahead, lag)
    start = random.normal(size=(3, n)) * [[1.0], [0.3], [0.3]]
    command, curvature, v = random.normal(size=n) * 0.3, random.normal(size=n) * 0.1, random.uniform(0.0, 10.0, n)
    found = np.array(model.advance(*start, command, curvature, v, h))
    truth = [exact(model, start[:, i], command[i], curvature[i], v[i], h) for i in range(n)]
    np.testing.assert_allclose(found.T, truth, atol=1e-10)


def test_without_lag_the_road_wheel_is_the_command() -> None:
    start, command, curvature, v = np.array([[0.1], [0.2], [0.3]]), np.array([0.05]), np.array([0.02]), np.array([4.0])
    found = CameraModel(3.0, 3.5, 0.0).advance(*start, command, curvature, v, 0.2)
    quick = CameraModel(3.0, 3.5, 1e-9).advance(*start, command, curvature, v, 0.2)
    np.testing.assert_allclose(found, quick, atol=1e-7)
    assert found[2] == pytest.approx(command)


def test_rate_is_the_deviations_derivative() -> None:
    start, zero, v = np.array([[0.1], [0.2], [0.3]]), np.zeros(1), np.array([4.0])
    h = 1e-6
    after = MODEL.advance(*start, zero, zero, v, h)[0]
    assert MODEL.rate(start[1], start[2], v) == pytest.approx((after - start[0]) / h, rel=1e-4)


def published(times: np.ndarray, start: tuple[float, float], braking: SimpleNamespace, steer, curvature: float):
    """Return x1 of (10): x1' = x2 + (f + l) v/l delta, x2' = v² kappa + v²/l delta; kappa positive to the right."""

    def rates(t: float, x: np.ndarray) -> list[float]:
        v = braking.speed(t)
        return [x[1] + 6.5 * v / 3.0 * steer(t), v * v * (-curvature) + v * v / 3.0 * steer(t)]

    first = [start[0], braking.speed(0.0) * start[1]]
    return solve_ivp(rates, (0.0, times[-1]), first, t_eval=times, rtol=1e-10, atol=1e-14).y[0]


def heading_form(times: np.ndarray, start: tuple[float, float], braking: SimpleNamespace, steer, curvature: float):
    """Return e of `CameraModel`, in steps with the speed and the angle of their middle."""
    quick = CameraModel(3.0, 3.5, 0.0)
    e, heading, delta = (np.array([value]) for value in (*start, 0.0))
    found = []
    for t, following in zip(times, [*times[1:], times[-1]], strict=True):
        found.append(e[0])
        middle = 0.5 * (t + following)
        command, v = np.array([steer(middle)]), np.array([braking.speed(middle)])
        e, heading, delta = quick.advance(e, heading, delta, command, np.array([curvature]), v, following - t)
    return np.array(found)


def van(times: np.ndarray, start: tuple[float, float], braking: SimpleNamespace, steer, curvature: float):
    """Return e of the exact van on a circle of ``curvature``: distance of the edge at the look-ahead point minus 1.5 m.

    The path starts at the origin along x; its edge is 1.5 m to the right, on a circle round the same centre.
    """
    centre, radius = 1.0 / curvature, 1.0 / curvature + 1.5

    def deviation(x: float, y: float, heading: float) -> float:
        px, py = x + 6.5 * math.cos(heading), y + 6.5 * math.sin(heading)
        # From the point to the right: (px, py) + u (sin, -cos) is on the circle of the edge.
        across = px * math.sin(heading) - (py - centre) * math.cos(heading)
        off = px * px + (py - centre) ** 2 - radius**2
        return -across + math.copysign(math.sqrt(across**2 - off), radius) - 1.5

    def rates(t: float, state: np.ndarray) -> list[float]:
        v, delta = braking.speed(t), steer(t)
        back = v * math.cos(delta)
        return [back * math.cos(state[2]), back * math.sin(state[2]), v * math.sin(delta) / 3.0]

    # The heading against the road at the look-ahead point is the start's; then the lateral place makes e the start's.
    heading = start[1] + 6.5 * curvature
    y = start[0] - deviation(0.0, 0.0, heading)
    path = solve_ivp(rates, (0.0, times[-1]), [0.0, y, heading], t_eval=times, rtol=1e-11, atol=1e-14).y
    return np.array([deviation(*state) for state in path.T])


def errors(final: float, small: float) -> tuple[float, float]:
    """Return the largest errors of (10) and of the heading form, over the largest deviation of the exact van.

    From 6 m/s to ``final`` in 4 s; start, steering and curvature in proportion to ``small``.
    """
    braking = SimpleNamespace(speed=lambda t: 6.0 + (final - 6.0) * t / 4.0)
    times = np.linspace(0.0, 4.0, 401)
    case = times, (small, 0.5 * small), braking, lambda t: small * math.sin(2.0 * t), 0.1 * small
    truth = van(*case)
    size = np.abs(truth).max()
    return np.abs(published(*case) - truth).max() / size, np.abs(heading_form(*case) - truth).max() / size


def test_both_forms_are_the_linearisation_at_constant_speed() -> None:
    for error in errors(final=6.0, small=1e-4):
        assert error < 1e-3
    case = np.linspace(0.0, 2.0, 2001), (0.3, 0.05), SimpleNamespace(speed=lambda t: 4.0), lambda t: 0.1, 0.02
    np.testing.assert_allclose(heading_form(*case), published(*case), atol=1e-7)


def test_while_braking_only_the_heading_form_is() -> None:
    """(10) keeps x2 = v theta while the speed falls: as if braking turned the van."""
    wrong, right = zip(*(errors(final=1.0, small=small) for small in (4e-3, 2e-3, 1e-3, 5e-4)), strict=True)
    assert min(wrong) > 0.2 and wrong[-1] == pytest.approx(wrong[-2], rel=0.01)
    assert right[-1] < 1e-3 and right[-1] < 0.6 * right[-2] < 0.4 * right[-3]
