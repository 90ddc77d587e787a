"""Werling, Gröll, Bretthauer 2008, (10) to (12): the car's tyres, and the front slip that gives a wanted force.

The front axle pushes across the course with F_eta(alpha) = F_f(alpha) cos(alpha - eta), where alpha - eta is the angle
between wheel and course. The source inverts this family by a two-dimensional map over its monotone range; here a
bracketed Newton iteration inverts it to the last digits, over a range that is known in closed form.

The range. F_eta rises while F_f'/F_f > tan(alpha - eta). Slip is held to |alpha| <= a, where the tyre gives ``margin``
of its peak, and the wheel to |alpha - eta| <= atan(F_f'(a)/F_f(a)) from the course. As F_f'/F_f falls with alpha, F_eta
rises all over that range, whatever eta is; its ends bound the force. Beyond the peak more slip gives less force, and a
car that steers there spins. (A margin of 0.95 leaves the wheel of an ordinary car on dry road 51 degrees to either side
of the course; towards 1 nothing is left, so that a margin is between 0.5 and 0.98.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters
from lanekeep_env.physics.tyres import MAGIC_FORMULA_SHAPE

#: Part of the tyre's peak force that is asked for at the most.
MARGIN = 0.95
#: Newton iterations; a fixed number, so that a row does not depend on its neighbours.
ITERATIONS = 10


class WerlingCar(NamedTuple):
    """What the laws know of the car: kg, kg m², m, m, N/rad, N/rad, N, N; numbers or (n,) each."""

    mass: float | Floats
    yaw_inertia: float | Floats
    to_front: float | Floats
    to_rear: float | Floats
    front_stiffness: float | Floats
    rear_stiffness: float | Floats
    front_peak: float | Floats
    rear_peak: float | Floats

    @classmethod
    def of(cls, car: VehicleParameters, friction: float = 1.0) -> WerlingCar:
        """Take a car on a road of the given friction: the peaks are friction times the static axle loads."""
        load = friction * car.mass * GRAVITY / car.wheelbase
        return cls(
            mass=car.mass,
            yaw_inertia=car.yaw_inertia,
            to_front=car.cg_to_front_axle,
            to_rear=car.cg_to_rear_axle,
            front_stiffness=car.front_cornering_stiffness,
            rear_stiffness=car.rear_cornering_stiffness,
            front_peak=load * car.cg_to_rear_axle,
            rear_peak=load * car.cg_to_front_axle,
        )

    @property
    def wheelbase(self) -> float | Floats:
        """Distance between the axles, m."""
        return self.to_front + self.to_rear


def axle_force(slip: Floats, stiffness: float | Floats, peak: float | Floats) -> Floats:
    """Return F(alpha) = D sin(1.5 atan(B alpha)) with B = C_alpha/(1.5 D), N, (n,): the environment's tyre."""
    return peak * np.sin(MAGIC_FORMULA_SHAPE * np.arctan(stiffness * slip / (MAGIC_FORMULA_SHAPE * peak)))


def slip_angles(
    beta: Floats, r: Floats, v: Floats, to_front: float | Floats, to_rear: float | Floats
) -> tuple[Floats, Floats]:
    """Return (eta, alpha_r), rad: front slip minus the wheel's angle to the course, and rear slip, (10a) and (1e)."""
    across, along = v * np.sin(beta), v * np.cos(beta)
    eta = beta - np.arctan((to_front * r + across) / along)
    return eta, np.arctan((to_rear * r - across) / along)


def front_slip(
    force: Floats, eta: Floats, stiffness: float | Floats, peak: float | Floats, margin: float = MARGIN
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the slip alpha with F_eta(alpha) = force, rad, and where the force was too much for the tyre, (n,) each.

    A force beyond the range's ends gives the end: `margin` of the peak, never the peak or what lies behind it.
    """
    shape = MAGIC_FORMULA_SHAPE
    steepness = stiffness / (shape * peak)
    phase = np.arcsin(margin) / shape
    largest = np.tan(phase) / steepness
    from_course = np.arctan(shape * steepness * np.cos(phase) ** 2 / np.tan(shape * phase))
    low = np.clip(eta - from_course, -largest, largest)
    high = np.clip(eta + from_course, -largest, largest)
    least = axle_force(low, stiffness, peak) * np.cos(low - eta)
    most = axle_force(high, stiffness, peak) * np.cos(high - eta)
    wanted = np.clip(force, least, most)
    # The tyre's own inverse, for a wheel along the course, is the first guess.
    slip = np.clip(np.tan(np.arcsin(np.clip(wanted / peak, -margin, margin)) / shape) / steepness, low, high)
    for _ in range(ITERATIONS):
        bent = shape * np.arctan(steepness * slip)
        own, cosine, sine = peak * np.sin(bent), np.cos(slip - eta), np.sin(slip - eta)
        rise = peak * shape * steepness * np.cos(bent) / (1.0 + (steepness * slip) ** 2)
        excess = own * cosine - wanted
        low, high = np.where(excess < 0.0, slip, low), np.where(excess > 0.0, slip, high)
        newton = slip - excess / (rise * cosine - own * sine)
        slip = np.where((newton < low) | (newton > high), 0.5 * (low + high), newton)
    return slip, np.not_equal(wanted, force)
