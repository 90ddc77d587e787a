"""Team KnightRiders 2017: the cascade along a wall, as published and redesigned for one sample of delay.

Distance P inside which works a heading P inside which works a yaw-rate PI (3.5); distances are those of the rear axle,
y - l_H phi, which removes the plant's zero (Figures 3.30 to 3.32). Source, signs and units: `wall_design`.

The published inner loop is algebraic: the plant from steering to yaw rate is a pure gain, and the PI's loop gain is 17.
Simulink solves it; a car measures the yaw rate one sample later, and then the loop is unstable from a gain of 1.82 on.
(Listing A.9 adds a second value of the inner pole, 2/3, whose gain of 0.588 is below that: `REAR_AXLE_POLE`.)

The redesign keeps the structure and the authors' own rules (no closed pole left of zero or off the real axis, inner
loops faster), for a loop with one sample of delay:

- rate: the zero moves from 0.1 to 0, on the pole of the delay, so that one real pole 1 - K is left of K/(z - 1);
  K = 2 (1 - m) for the modulus margin m = 0.75, K = 0.5. A further sample of delay (a servo, a slow sensor) leaves it a
  damping of 0.40; the published closed pole 0.15 (K = 0.85) would be left with 0.08.
- heading: at the breakaway point, a double pole at 0.71.
- distance: at the breakaway point, poles 0.89, 0.89, 0.63; k2 v = 1.13 1/s. At low speed that asks for more than the
  steering can give: the heading asked for is at most 30 degrees, and k2 at most what turns back from there with half of
  the largest curvature, 1.15 rad/m (from 0.98 m/s down).

Anti-windup is by clamping: the PI with its zero at 0 is the last steering, as limited, plus gain times error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.wall_design import WallCar

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class CascadeDesign:
    """Distance P inside which works a heading P inside which works a yaw-rate PI; rates are angles per step.

    Attributes:
        rate_gain: k of the PI k (z - rate_zero)/(z - 1), steering per angle per step.
        rate_zero: its zero.
        heading_gain: k1, 1/step.
        distance_gain: k2, angle per m.
    """

    rate_gain: Floats
    rate_zero: float
    heading_gain: float
    distance_gain: Floats


#: Of the published cascade: zero and closed pole of the inner loop, and the gain read off the locus of the middle one.
RATE_ZERO, RATE_POLE, HEADING_LOOP_GAIN = 0.1, 0.15, 0.556
#: The inner pole that listing A.9 adds as a "new value" for distances of the rear axle: loop gain 0.588, which with one
#: sample of delay leaves poles at 0.524 and -0.112 and does not chatter. No gain of the middle loop is printed for it.
REAR_AXLE_POLE = 2.0 / 3.0
#: Gain of its distance at this speed, m/s, in degrees and in radians per m; at others in proportion to 1/v. The report
#: prints none: with 4 its simulation swings "hardly" (Figure 3.35), with 2 the car in radians does not either.
DISTANCE_GAIN_SPEED, DISTANCE_GAIN_DEGREES, DISTANCE_GAIN_RADIANS = 0.4, 4.0, 2.0


def published_rate_loop_gain(pole: float = RATE_POLE) -> float:
    """Return k v T/l = |z_p - 1|/|z_p - n| for a closed pole z_p, 17 for the report's (3.5.3)."""
    return abs(pole - 1.0) / abs(pole - RATE_ZERO)


def heading_locus(step: float) -> control.TransferFunction:
    """Return the middle loop without its gain: (20), its gain left out too, times the integrator of the heading."""
    import control  # for the loci only: the gains are designed without it

    loop = published_rate_loop_gain()
    return control.zpk([RATE_ZERO], [1.0, (1.0 + RATE_ZERO * loop) / (1.0 + loop)], 1.0, step)


def published_cascade(car: WallCar, speed: ArrayLike, distance_gain: ArrayLike) -> CascadeDesign:
    """Return the cascade of 3.5 (listings A.9 and A.11); the report prints no distance gain."""
    loop = published_rate_loop_gain()
    heading = HEADING_LOOP_GAIN * (1.0 + loop) / loop
    return CascadeDesign(loop / car.turn(speed), RATE_ZERO, heading, np.asarray(distance_gain, dtype=np.float64))


#: Of the redesign: modulus margin of the inner loop, largest heading asked for, rad, and the steering limit, rad, which
#: is an assumption (the report prints none), with the share of its curvature that the distance loop may plan with.
MODULUS_MARGIN = 0.75
LARGEST_HEADING = float(np.deg2rad(30.0))
STEERING_LIMIT = float(np.deg2rad(22.0))
PLANNED_SHARE = 0.5


def delayed_rate_locus(loop_gain: float, zero: float, step: float) -> control.TransferFunction:
    """Return the inner loop with its gain and one sample of delay."""
    import control

    return control.zpk([zero], [0.0, 1.0], loop_gain, step)


@cache
def redesigned_loop_gains(margin: float = MODULUS_MARGIN) -> tuple[float, float, float]:
    """Return K = k v T/l, k1 in 1/step, and k2 v T: the loop gains of rate, heading and distance.

    Heading: k1 K z/((z - 1)(z - p)), p = 1 - K, breaks away at sqrt(p), where k1 K = (1 - sqrt(p))².
    Distance: k2 v T (z + 1)/(2 (z - 1)) times k1 K z/(z - sqrt(p))² breaks away where its gain is stationary.
    """
    rate = 2.0 * (1.0 - margin)
    double = np.sqrt(1.0 - rate)
    heading = (1.0 - double) ** 2
    over = np.poly([1.0, double, double])
    under = 0.5 * heading * np.array([1.0, 1.0, 0.0])
    stationary = np.polysub(np.polymul(np.polyder(over), under), np.polymul(over, np.polyder(under)))
    roots = np.roots(stationary)
    point = max(root.real for root in roots if abs(root.imag) < 1e-9 and double + 1e-6 < root.real < 1.0 - 1e-6)
    return float(rate), float(heading / rate), float(-np.polyval(over, point) / np.polyval(under, point))


def redesigned_cascade(car: WallCar, speed: ArrayLike) -> CascadeDesign:
    """Return the cascade for a yaw rate that comes one sample late, in radians."""
    rate, heading, distance = redesigned_loop_gains()
    curvature = np.tan(STEERING_LIMIT) / car.wheelbase
    most = PLANNED_SHARE * curvature / np.sin(LARGEST_HEADING)
    way = np.asarray(speed, dtype=np.float64) * car.step
    return CascadeDesign(rate / car.turn(speed), 0.0, heading, np.minimum(distance / way, most))
