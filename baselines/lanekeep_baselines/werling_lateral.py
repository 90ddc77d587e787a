"""Werling, Gröll, Bretthauer 2008: steering from standstill to speed along a path, as pure functions over rows.

Above v_d the centre of gravity follows the path by input/output linearisation of the car with saturating tyres (1),
below v_k the rear axle does by that of the rolling car (13), between them the two angles are blended (24).

Signs are the source's and the project's. Its theta_CoG is the COURSE error, heading error plus sideslip; its theta_RA
is the heading error. In reverse kappa, d and theta keep the orientation of forward driving.

Additions to the source, each told where it stands: slip is held below the tyres' peak and rows are told where the path
asks for more; 1 - d kappa and cos theta are held above a tenth; the last direction is held at standstill; the dynamic
law is shifted to the circle that the centre of gravity runs on while the rear axle is on the path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.werling_tyres import MARGIN, WerlingCar, axle_force, front_slip, slip_angles

#: 1 - d kappa and cos(theta) are held at or above this. At d = 1/kappa the path has no nearest point, and across the
#: path no steering changes d'': a jump of the measured position must not ask for an unbounded force there. The
#: environment's cars hold 1 - d kappa likewise.
SMALLEST = 0.1


class WerlingTuning(NamedTuple):
    """Of both laws and the blend.

    Attributes:
        frequency: omega of d'' + 2 omega d' + omega² d = 0 at speed, 1/s (c1 = omega², c2 = 2 omega).
        wave_number: k of the same equation over the way of the rear axle, 1/m (k1 = k², k2 = 2 k).
        slow: v_k, m/s: the kinematic law alone up to here.
        fast: v_d, m/s: the dynamic law alone from here on.
        margin: part of the tyre's peak that is asked for at the most.
    """

    frequency: float = 1.0
    wave_number: float = 0.5
    slow: float = 2.5
    fast: float = 4.5
    margin: float = MARGIN

    def part(self, v: Floats) -> Floats:
        """Return the dynamic law's part of the blend at v, m/s: 0 to 1, (n,)."""
        return np.clip((v - self.slow) / (self.fast - self.slow), 0.0, 1.0)


class WerlingMeasured(NamedTuple):
    """What the laws read of the centre of gravity, (n,) each: m, rad, rad, rad/s, m/s.

    Lateral and heading error, sideslip, yaw rate and speed; where the laws are blended, ``beta`` and ``r`` may be
    anything at or below v_k.
    """

    d: Floats
    heading: Floats
    beta: Floats
    r: Floats
    v: Floats


def dynamic_steering(
    car: WerlingCar,
    frequency: float | Floats,
    at: WerlingMeasured,
    kappa: Floats,
    wanted: float | Floats = 0.0,
    margin: float = MARGIN,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the road-wheel angle of (7), (9), (12), rad, and where the path asks for more than the tyres give, (n,).

    Without a limit, d'' + 2 omega d' + omega² d = 0 exactly, at any speed and for large d and theta.

    Args:
        car: the car, with the friction that is believed in.
        frequency: omega, 1/s.
        at: measurements at the centre of gravity; forward and well above standstill, elsewhere the law does not hold.
        kappa: curvature of the path, 1/m.
        wanted: lateral position that d decays to, m.
        margin: part of the tyre's peak that is asked for at the most.
    """
    d, _, beta, r, v = at
    course = at.heading + beta  # theta
    cosine = np.cos(course)
    pull = -frequency * (frequency * (d - wanted) + 2.0 * v * np.sin(course))
    turning = v * v * kappa * cosine / np.maximum(1.0 - d * kappa, SMALLEST)
    eta, rear_slip = slip_angles(beta, r, v, car.to_front, car.to_rear)
    rear = axle_force(rear_slip, car.rear_stiffness, car.rear_peak) * np.cos(beta)
    force = car.mass * (pull / np.maximum(cosine, SMALLEST) + turning) - rear
    slip, limited = front_slip(force, eta, car.front_stiffness, car.front_peak, margin)
    return beta + slip - eta, limited


def kinematic_steering(
    wheelbase: float | Floats,
    wave_number: float | Floats,
    d: Floats,
    heading: Floats,
    direction: Floats,
    kappa: Floats,
) -> Floats:
    """Return the road-wheel angle of (23), rad, (n,): in either direction d decays over the way, not over time.

    Args:
        wheelbase: l, m.
        wave_number: k, 1/m.
        d: lateral error of the rear axle, m.
        heading: heading error there, rad.
        direction: +1 forwards, -1 in reverse; see `hold_direction`.
        kappa: curvature of the path, 1/m.
    """
    cosine = np.cos(heading)
    pull = -wave_number * (wave_number * d + 2.0 * direction * np.sin(heading))
    turning = kappa * cosine / np.maximum(1.0 - d * kappa, SMALLEST)
    return np.arctan(wheelbase * (pull / np.maximum(cosine, SMALLEST) + turning))


def hold_direction(v: Floats, last: Floats) -> Floats:
    """Return sgn(v), and at standstill the last direction: sgn(0) = 0 would step the steering, (n,)."""
    return np.where(v == 0.0, last, np.sign(v))


def shifted(d: Floats, heading: Floats, kappa: Floats, ahead: float | Floats) -> tuple[Floats, Floats]:
    """Return lateral and heading error of a point ``ahead`` (m) of the reference point, (n,) each.

    Exact on a path of constant curvature. The rear axle is -l_r ahead of the centre of gravity.
    """
    x, y = ahead * np.cos(heading), d + ahead * np.sin(heading)
    along, across = kappa * x, 1.0 - kappa * y
    # (1 - distance from the centre times kappa)/kappa, in a form that is good for kappa = 0.
    lateral = (2.0 * y - kappa * (x * x + y * y)) / (1.0 + np.sqrt(along * along + across * across))
    return lateral, heading - np.arctan2(along, across)


def blended_steering(
    car: WerlingCar,
    tuning: WerlingTuning,
    at: WerlingMeasured,
    direction: Floats,
    kappa: Floats,
    early: Floats | None = None,
    shift: float = 1.0,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the road-wheel angle of (24), rad, and where the dynamic law has a say and is limited, (n,) each.

    The laws regulate different points: in a steady curve with the rear axle on the path, the centre of gravity runs
    l_r² kappa/2 outside. The dynamic law is shifted by that, or the car would change its line with its speed.

    Args:
        car, tuning: as above.
        at: measurements at the centre of gravity.
        direction: of driving, +1 or -1.
        kappa: curvature of the path beside the car, 1/m.
        early: curvature that the laws steer for, 1/m, where it is to be another: see `curvature_ahead`.
        shift: part of l_r² kappa/2 by which the dynamic law is shifted, 0 for the source's law.
    """
    steered_for = kappa if early is None else early
    rear_d, rear_heading = shifted(at.d, at.heading, kappa, -car.to_rear)
    slow = kinematic_steering(car.wheelbase, tuning.wave_number, rear_d, rear_heading, direction, steered_for)
    part = tuning.part(at.v)
    blend = part > 0.0
    # Rows that have no use for the dynamic law show it a harmless state: neither v = 0 nor what beta is there.
    beta, r, v = np.where(blend, at.beta, 0.0), np.where(blend, at.r, 0.0), np.maximum(at.v, tuning.slow)
    shown = at._replace(beta=beta, r=r, v=v)
    wanted = -0.5 * shift * car.to_rear**2 * kappa
    quick, limited = dynamic_steering(car, tuning.frequency, shown, steered_for, wanted, tuning.margin)
    return slow + part * (quick - slow), limited & blend


def curvature_ahead(samples: Floats, spacing: float, distance: Floats) -> Floats:
    """Return the curvature ``distance`` m ahead, (n,), linear between previews and held beyond the last.

    The steering actuator turns late by its lag (and by half a control step of held command): a law that steers for the
    curvature v times that ahead turns in time. Near the smallest circle it is the larger part of the error.

    Args:
        samples: curvature at 0, ``spacing``, 2 ``spacing``, ... ahead in the direction of driving, 1/m, (n, p).
        spacing: m.
        distance: m, (n,), at least 0.
    """
    last = samples.shape[1] - 1
    place = np.clip(distance / spacing, 0.0, float(last))
    first = np.minimum(place.astype(np.intp), max(last - 1, 0))
    rows = np.arange(len(samples))
    before, after = samples[rows, first], samples[rows, np.minimum(first + 1, last)]
    return before + (place - first) * (after - before)
