"""From identified coefficients to a car, and to controllers designed on it.

The coefficients are ratios. With cf = C_f/m, cr = C_r/m, k = J/m and the known steering ratio i,

    a11 = -(cf + cr), a12 = cr l_r - cf l_f, a21 = a12/k, a22 = -(cf l_f² + cr l_r²)/k, b1 = cf/i, b2 = cf l_f/(k i):

six numbers of five unknowns. They fix both distances l_f and l_r, the stiffnesses over the mass and the inertia over
the mass; one mass or one inertia, known from elsewhere, gives the scale, which no controller here depends on.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

import lanekeep_baselines
from lanekeep_baselines.identification.result import Identification
from lanekeep_baselines.policy import Floats, Policy
from lanekeep_env.checks import require
from lanekeep_env.physics.parameters import SteeringActuator, VehicleParameters

#: Yin's car: where the search starts; cf, cr (m/s²), k (m²), l_f, l_r (m).
_ORDINARY = np.array([36.0, 63.0, 1.6, 1.3, 1.5])


def _coefficients(shape: Floats, ratio: float) -> Floats:
    """Return a11, a12, a21, a22, b1, b2 of (cf, cr, k, l_f, l_r)."""
    cf, cr, k, front, rear = shape
    moment = cr * rear - cf * front
    a22 = -(cf * front**2 + cr * rear**2) / k
    return np.array([-(cf + cr), moment, moment / k, a22, cf / ratio, cf * front / (k * ratio)])


def _nearest_shape(found: Identification, wheelbase: float | None) -> tuple[float, ...]:
    """Return the (cf, cr, k, l_f, l_r) with coefficients nearest to the identified ones; ValueError: none is near."""
    wanted = np.array([found.values[name] for name in ("a11", "a12", "a21", "a22", "b1", "b2")])
    root = np.linalg.cholesky(found.covariance_matrix()[:6, :6])

    def shape(logarithms: Floats) -> Floats:  # all five are positive
        values = _ORDINARY * np.exp(logarithms)
        if wheelbase is not None:
            values[3:] *= wheelbase / (values[3] + values[4])
        return values

    def misfit(logarithms: Floats) -> Floats:
        return solve_triangular(root, _coefficients(shape(logarithms), found.steering_ratio) - wanted, lower=True)

    fit = least_squares(misfit, np.zeros(5), x_scale=0.1)
    # Above this, chance is no explanation (five standard deviations for each number too many).
    if not fit.cost < 0.5 * 25.0 * (1 if wheelbase is None else 2):
        raise ValueError(
            f"no car with a steering ratio of {found.steering_ratio:g}"
            f"{'' if wheelbase is None else f' and a wheelbase of {wheelbase:g} m'} has coefficients near the "
            f"identified ones: the nearest is {np.sqrt(2.0 * fit.cost):.1f} standard errors off"
        )
    return tuple(float(value) for value in shape(fit.x))


def vehicle_from_identification(
    found: Identification,
    *,
    mass: float | None = None,
    yaw_inertia: float | None = None,
    wheelbase: float | None = None,
    base: VehicleParameters | None = None,
) -> VehicleParameters:
    """Return the car whose coefficients are nearest to the identified ones, measured by their covariance.

    Six coefficients of five unknowns (four with the wheelbase): where the steering ratio is right, those of the car are
    a little better than the identified ones.

    Args:
        found: the identification; its steering ratio is taken as known.
        mass, yaw_inertia: kg or kg m²; one of them, for the scale.
        wheelbase: m, where it is known.
        base: what to keep all else of (steering ratio and limits, delay, body); None for a car without limits.

    Raises:
        ValueError: not exactly one of mass and inertia; or no car has coefficients near these.
    """
    if (mass is None) == (yaw_inertia is None):
        raise ValueError("give mass (kg) or yaw_inertia (kg m²), one of them: the coefficients fix only their ratio")
    require("mass", mass, "kg", above=0.0, optional=True)
    require("yaw_inertia", yaw_inertia, "kg m²", above=0.0, optional=True)
    require("wheelbase", wheelbase, "m", above=0.0, optional=True)
    cf, cr, k, front, rear = _nearest_shape(found, wheelbase)
    scale = mass if mass is not None else (yaw_inertia or 0.0) / k
    old = base or VehicleParameters("identified", 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, steering_ratio=found.steering_ratio)
    steering = old.steering if base else SteeringActuator()
    return replace(
        old,
        name=f"{old.name} (identified)" if base else "identified",
        mass=scale,
        yaw_inertia=k * scale,
        cg_to_front_axle=front,
        cg_to_rear_axle=rear,
        front_cornering_stiffness=cf * scale,
        rear_cornering_stiffness=cr * scale,
        steering=replace(steering, lag=max(found.values["lag"], 0.0)),
        source="identified from a driven run",
    )


def redesign(name: str, scenario: Any, found: Identification) -> Policy:
    """Return the policy ``name`` for ``scenario``, designed on the identified car instead of the scenario's.

    Mass, limits and delay stay those of the scenario's car; no gain depends on the mass.
    """
    car = vehicle_from_identification(found, mass=scenario.vehicle.mass, base=scenario.vehicle)
    return lanekeep_baselines.make(name, replace(scenario, vehicle=car))
