"""The F1TENTH car against the single track of its source, whose stiffnesses are normalised by friction and load."""

import numpy as np
import pytest

from lanekeep_benchmarks.check.vehicles import eigenvalues, understeer_gradient
from lanekeep_env.physics import VEHICLES

#: f1tenth_gym's default parameters, under its names.
P = {"mu": 1.0489, "C_Sf": 4.718, "C_Sr": 5.4562, "lf": 0.15875, "lr": 0.17145, "h": 0.074, "m": 3.74, "I": 0.04712}


def single_track(v):
    """The matrix of (sideslip, yaw rate) of f1tenth_gym's single track without longitudinal acceleration."""
    g, base = 9.81, P["lf"] + P["lr"]
    front, rear = P["C_Sf"] * g * P["lr"], P["C_Sr"] * g * P["lf"]
    turn = P["mu"] * P["m"] / (P["I"] * base)
    return np.array(
        [
            [-P["mu"] / (v * base) * (rear + front), P["mu"] / (v**2 * base) * (rear * P["lr"] - front * P["lf"]) - 1],
            [turn * (P["lr"] * rear - P["lf"] * front), -turn / v * (P["lf"] ** 2 * front + P["lr"] ** 2 * rear)],
        ]
    )


@pytest.mark.parametrize("speed", [1.0, 3.0, 7.0, 20.0])
def test_the_source_s_single_track_has_the_car_s_eigenvalues(speed):
    expected = np.sort_complex(np.linalg.eigvals(single_track(speed)))
    np.testing.assert_allclose(np.sort_complex(eigenvalues(VEHICLES["f1tenth"], speed)), expected, rtol=1e-9)


def test_understeer_gradient_is_that_of_the_normalised_stiffnesses():
    """Load-proportional tyres: slip angles are a / (mu g C_S), whatever the mass and the axles."""
    expected = (1.0 / P["C_Sf"] - 1.0 / P["C_Sr"]) / (P["mu"] * 9.81)
    assert understeer_gradient(VEHICLES["f1tenth"]) == pytest.approx(expected, rel=1e-9)


def test_the_other_numbers_are_the_source_s():
    car = VEHICLES["f1tenth"]
    assert (car.mass, car.yaw_inertia, car.cg_to_front_axle, car.cg_to_rear_axle) == tuple(
        P[k] for k in ("m", "I", "lf", "lr")
    )
    assert (car.steering.angle_limit, car.steering.rate_limit, car.length, car.width) == (0.4189, 3.2, 0.58, 0.31)
