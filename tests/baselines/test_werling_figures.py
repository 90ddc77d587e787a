"""Werling's Figures 8 and 9, and a path that the tyres cannot follow, on the independent car, sampled at 50 Hz."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lanekeep_baselines.werling_lateral import WerlingMeasured, curvature_ahead, dynamic_steering, kinematic_steering
from lanekeep_baselines.werling_tyres import WerlingCar
from lanekeep_env.physics.parameters import VehicleParameters

VEHICLE = VehicleParameters("annieway", 1950.0, 3200.0, 1.20, 1.51, 90e3, 120e3)
SPEED = 55.0 / 3.6
LARGEST_ANGLE = 0.6


def shipped(friction: float, omega: float = 1.0):
    """The law with the friction that it believes in, behind the stops of the steering."""
    car = WerlingCar.of(VEHICLE, friction)

    def law(*values: float) -> tuple[float, bool]:
        d, heading, beta, r, v, kappa = (np.array([float(x)]) for x in values)
        steer, limited = dynamic_steering(car, omega, WerlingMeasured(d, heading, beta, r, v), kappa)
        return float(np.clip(steer[0], -LARGEST_ANGLE, LARGEST_ANGLE)), bool(limited[0])

    return law


def test_figure_8(werling) -> None:
    """3.5 m aside over 36.7 m at 55 km/h, 0.8 m off at the start, which the source shows before the bend: 10 m here.

    The error falls steadily although the lateral acceleration reaches 4.0 m/s².
    """
    run = werling.drive(shipped(1.0), werling.LaneChange(3.5, 36.7), (-10.0, 0.8), SPEED, 5.0)
    d = np.abs(run.d)
    assert run.acceleration.max() == pytest.approx(3.99, rel=0.01)
    assert d[150] == pytest.approx(0.215, rel=0.02)
    assert (d - np.minimum.accumulate(d)).max() < 0.005
    assert not run.limited.any()


def test_lane_change_on_friction_0_3_is_told_to_be_infeasible(werling) -> None:
    """2.94 m/s² where 3.96 are asked for: the rows say so, the car is late and comes back."""
    run = werling.drive(shipped(0.3), werling.LaneChange(3.5, 36.7), (-10.0, 0.8), SPEED, 7.0, friction=0.3)
    assert run.limited.any() and not run.limited[-100:].any()
    assert run.acceleration.max() < 0.3 * 9.81
    assert np.abs(run.beta).max() < 0.1 and np.abs(run.d).max() < 1.0 and abs(run.d[-1]) < 0.02


def clipped_at_the_peak(werling, friction: float):
    """The same law as printed, with the map's end, the peak of F_eta, as its only limit."""
    front_peak, rear_peak = werling.peaks(friction)
    end = np.tan(np.pi / 3.0) * 1.5 * front_peak / werling.FRONT_STIFFNESS
    slips = np.linspace(-end, end, 2001)
    forces = werling.tyre(slips, werling.FRONT_STIFFNESS, front_peak)

    def law(d, heading, beta, r, v, kappa) -> tuple[float, bool]:
        course = heading + beta
        across = v * np.sin(beta)
        eta = beta - np.arctan2(werling.FRONT * r + across, v * np.cos(beta))
        rear = werling.tyre(np.arctan2(werling.REAR * r - across, v * np.cos(beta)), werling.REAR_STIFFNESS, rear_peak)
        pull = (-d - 2.0 * v * np.sin(course)) / max(np.cos(course), 0.1)
        turning = v * v * kappa * np.cos(course) / max(1.0 - d * kappa, 0.1)
        family = forces * np.cos(slips - eta)
        low, high = int(family.argmin()), int(family.argmax())
        if low >= high:  # the car goes backwards: spun
            return 0.0, True
        force = werling.MASS * (pull + turning) - rear * np.cos(beta)
        steer = beta + np.interp(force, family[low : high + 1], slips[low : high + 1]) - eta
        return float(np.clip(steer, -LARGEST_ANGLE, LARGEST_ANGLE)), not family[low] <= force <= family[high]

    return law


def test_inverse_clipped_at_the_peak_spins_on_friction_0_3_and_the_shipped_one_does_not(werling) -> None:
    """A bend for 3.96 m/s². Both run wide, as they must; the clipped law's rear axle breaks away."""
    bend = werling.Circle(3.96 / SPEED**2)
    printed = werling.drive(clipped_at_the_peak(werling, 0.3), bend, (0.0, 0.0), SPEED, 6.0, friction=0.3)
    run = werling.drive(shipped(0.3), bend, (0.0, 0.0), SPEED, 6.0, friction=0.3)
    assert np.abs(printed.beta).max() > 1.0
    assert np.abs(run.beta).max() < 0.1
    assert run.limited[-1]
    assert 0.9 * 0.3 * 9.81 < run.acceleration[-1] < 0.3 * 9.81


def parking(radius: float, transition: float, arc: float) -> Callable[[float], float]:
    """Curvature of an S in reverse over s from 0 down: 1 m straight, right and left arc, linear transitions."""
    ends = np.cumsum([1.0, transition, arc, 2.0 * transition, arc, transition])
    values = np.array([0.0, 1.0, 1.0, -1.0, -1.0, 0.0]) / radius
    return lambda s: float(np.interp(-s, ends, values, left=0.0, right=0.0))


def parked(werling, path: Callable[[float], float], v: float, k: float, ahead: float = 0.0) -> float:
    """Return the largest error of the rear axle, m, with a steering lag of 0.1 s."""

    def law(d: float, heading: float, s: float) -> float:
        previews = np.array([[path(s - 0.1 * i) for i in range(5)]])
        kappa = curvature_ahead(previews, 0.1, np.array([ahead * v]))
        row = (np.array([float(x)]) for x in (d, heading, -1.0))
        return float(np.clip(kinematic_steering(werling.WHEELBASE, k, *row, kappa)[0], -LARGEST_ANGLE, LARGEST_ANGLE))

    return float(np.abs(werling.reverse(law, path, -v, 12.0 / v, 0.1)).max())


@pytest.mark.parametrize("transition", [0.4, 0.5])
def test_figure_9(werling, transition: float) -> None:
    """Reverse parking on R = 5 m; walking speed is 1.4 m/s, or 1.0. The source tells neither lag nor transitions.

    As printed the error is under 1 cm with k = 2 only; with curvature taken one lag ahead with k = 1.
    """
    path = parking(5.0, transition, 2.5)
    assert 0.024 <= parked(werling, path, 1.4, 1.0) <= 0.036
    assert 0.007 <= parked(werling, path, 1.0, 2.0) <= 0.009
    assert parked(werling, path, 1.4, 1.0, ahead=0.1) <= 0.004
    assert parked(werling, path, 1.0, 1.0, ahead=0.1) <= 0.004
