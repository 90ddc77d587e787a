"""Werling's two lateral laws together: rear axle and centre of gravity, and the blend over the speed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lanekeep_baselines.werling_lateral import (
    WerlingMeasured,
    WerlingTuning,
    blended_steering,
    dynamic_steering,
    hold_direction,
    kinematic_steering,
    shifted,
)
from lanekeep_baselines.werling_tyres import WerlingCar
from lanekeep_env.physics.parameters import VehicleParameters

CAR = WerlingCar.of(VehicleParameters("annieway", 1950.0, 3200.0, 1.20, 1.51, 90e3, 120e3))
LENGTH = CAR.wheelbase


def steady_on_circle(werling, law, v: float, radius: float) -> tuple[float, float]:
    """Return lateral and heading error of the centre of gravity after 40 s, ideal steering, car with slip."""

    def rates(_, x):
        d, heading, beta, r = x
        beta_rate, r_rate, _ = werling.body_rates(beta, r, law(d, heading, beta, r, 1.0 / radius), v)
        course = heading + beta
        return [v * np.sin(course), r - v * np.cos(course) / (radius - d), beta_rate, r_rate]

    end = solve_ivp(rates, (0.0, 40.0), [0.0, 0.0, 0.0, v / radius], method="LSODA", rtol=1e-7, atol=1e-9).y[:, -1]
    return end[0], end[1]


def one_row(*values):
    return [np.array([float(x)]) for x in values]


def test_centre_of_gravity_runs_outside_where_the_rear_axle_is_exact(werling) -> None:
    """l_r²/(2 R): 11 cm at R = 10 m. At a crawl nothing slips."""

    def law(d, heading, beta, r, kappa):
        there = shifted(*one_row(d, heading, kappa), -1.51)
        return kinematic_steering(LENGTH, 1.0, *there, np.ones(1), np.array([kappa]))[0]

    d, heading = steady_on_circle(werling, law, 0.5, 10.0)
    assert d == pytest.approx(-(1.51**2) / 20.0, rel=0.05)
    assert shifted(*one_row(d, heading, 0.1), -1.51)[0][0] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("radius", [10.0, -10.0])
def test_shifted_reference_closes_the_gap_between_the_laws(werling, radius: float) -> None:
    """The blend's two ends meet ten times closer than the source's, at the lower end, without slip."""
    tuning = WerlingTuning(wave_number=1.0, slow=0.5, fast=1.0)

    def law(share, shift):
        speed = tuning.slow + share * (tuning.fast - tuning.slow)

        def steer(d, heading, beta, r, kappa):
            at = WerlingMeasured(*one_row(d, heading, beta, r, speed))
            return blended_steering(CAR, tuning, at, np.ones(1), np.array([kappa]), shift=shift)[0][0]

        return steer

    slow = steady_on_circle(werling, law(0.0, 1.0), 1.0, radius)[0]
    shipped, literal = (steady_on_circle(werling, law(1.0, shift), 1.0, radius)[0] for shift in (1.0, 0.0))
    assert literal == pytest.approx(0.0, abs=1e-4)
    assert abs(shipped - slow) < 0.1 * abs(literal - slow)


@pytest.mark.parametrize(("k", "damped"), [(0.5, True), (1.0, False)])
def test_wave_number_of_the_blend(werling, k: float, damped: bool) -> None:
    """The kinematic law on the car with slip and a lag of 50 ms: k = 1 is badly damped above 4 m/s."""
    a = np.zeros((5, 5))
    a[:4] = werling.linear_car(4.5)
    one = np.ones(1)

    def law(x):
        there = shifted(x[0] * one, x[1] * one, 0.0 * one, -1.51)
        return kinematic_steering(LENGTH, k, *there, one, 0.0 * one)[0]

    a[4, :4], a[4, 4] = werling.gradient(law, 4) / 0.05, -1.0 / 0.05
    poles = np.linalg.eigvals(a)
    assert ((-poles.real / np.abs(poles)).min() > 0.7) == damped
    assert (-poles.real / np.abs(poles)).min() < 0.45 or damped


def test_below_v_k_the_dynamic_law_is_not_asked() -> None:
    """At standstill and in reverse sideslip is not defined; above v_d the kinematic law has no say."""
    tuning, nothing = WerlingTuning(), np.full(4, np.nan)
    v = np.array([-3.0, 0.0, 1.0, tuning.slow])
    at = WerlingMeasured(np.full(4, 0.2), np.full(4, 0.1), nothing, nothing, v)
    direction = hold_direction(v, np.ones(4))
    steer, limited = blended_steering(CAR, tuning, at, direction, np.full(4, 0.05))
    d, heading = shifted(at.d, at.heading, np.full(4, 0.05), -1.51)
    assert (steer == kinematic_steering(LENGTH, 0.5, d, heading, direction, np.full(4, 0.05))).all()
    assert not limited.any()
    v = np.array([tuning.fast, 12.0])
    at = WerlingMeasured(*(np.full(2, x) for x in (0.2, 0.1, 0.01, 0.05)), v)
    steer, _ = blended_steering(CAR, tuning, at, np.ones(2), np.full(2, 0.01))
    alone = dynamic_steering(CAR, 1.0, at, np.full(2, 0.01), -0.0114005)
    assert steer == pytest.approx(alone[0], abs=1e-9)


def test_blend_is_continuous() -> None:
    v = np.linspace(-1.0, 8.0, 9001)
    at = WerlingMeasured(*(np.full(9001, x) for x in (0.2, -0.05, 0.01, 0.1)), v)
    steer, _ = blended_steering(CAR, WerlingTuning(), at, hold_direction(v, np.ones(9001)), np.full(9001, 0.03))
    forward = v > 0.0
    assert np.abs(np.diff(steer[forward])).max() < 1e-3


def test_direction_is_held_at_standstill() -> None:
    found = hold_direction(np.array([0.0, 0.0, -0.1, 2.0]), np.array([1.0, -1.0, 1.0, -1.0]))
    assert found.tolist() == [1.0, -1.0, -1.0, 1.0]


def test_rows_do_not_depend_on_each_other() -> None:
    random = np.random.default_rng(2)
    columns = [random.normal(0.0, s, 50) for s in (0.5, 0.2, 0.05, 0.2)] + [random.uniform(-2.0, 30.0, 50)]
    kappa, direction = random.normal(0.0, 0.02, 50), np.ones(50)
    steer, limited = blended_steering(CAR, WerlingTuning(), WerlingMeasured(*columns), direction, kappa)
    for i in (0, 17, 49):
        one = WerlingMeasured(*(x[i : i + 1] for x in columns))
        alone, stopped = blended_steering(CAR, WerlingTuning(), one, direction[:1], kappa[i : i + 1])
        assert alone[0] == steer[i] and stopped[0] == limited[i]
