"""Team KnightRiders 2017: the controllers along a wall, as designs; which gains follow from which rule.

Source: Team KnightRiders, report of the seminar with 1:10 cars, 2017, chapter 3 and its appendix (the numbers of the
equations are theirs). y is the distance of the side sensor from the wall on the right, phi the heading away from it;
steering is positive away from the wall. That is positive to the left, as everywhere here: nothing changes sign.

Units: every gain is a number per unit of the angles. The authors' simulation put metres and degrees into the same
matrices, so that a gain of 88 was 88 degrees per metre on the car and 88 per metre in the design.

Speeds are m/s, numbers or arrays; gains come back elementwise. No gain exists at standstill.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lanekeep_baselines.policy import Floats

if TYPE_CHECKING:
    import control

#: Speed at which the competition's PD was designed, m/s, and the place of its sensor, m; the report gives neither: they
#: are those at which the printed poles come back.
PD_SPEED, PD_SENSOR = 1.8, 0.14


@dataclass(frozen=True)
class WallCar:
    """What the designs know of the car.

    Attributes:
        wheelbase: l, m.
        sensor: l_H, rear axle to side sensor, m; 0.175 in the listings of the first two approaches, 0.14 in those of
            the cascade.
        step: T, s.
    """

    wheelbase: float = 0.35
    sensor: float = 0.175
    step: float = 0.045

    def turn(self, speed: ArrayLike) -> Floats:
        """Return v T/l, what one unit of steering turns the heading by in one step."""
        return np.asarray(speed, dtype=np.float64) * self.step / self.wheelbase

    def gain(self, speed: ArrayLike) -> Floats:
        """Return v l_H T/l + v² T²/(2 l), the gain of (11) and b's first entry."""
        return self.turn(speed) * (self.sensor + np.asarray(speed, dtype=np.float64) * self.step / 2.0)

    def zero(self, speed: ArrayLike) -> Floats:
        """Return n3 of (11), (l_H - v T/2)/(l_H + v T/2); it is (22)'s as well, which prints (l_H - v T/2)/2."""
        way = np.asarray(speed, dtype=np.float64) * self.step
        return (2.0 * self.sensor - way) / (2.0 * self.sensor + way)

    def plant(self, speed: float) -> tuple[Floats, Floats]:
        """Return A_d (2, 2) and b_d (2, 1) of the states (y, phi), (8) and (9)."""
        a = np.array([[1.0, speed * self.step], [0.0, 1.0]])
        return a, np.array([[float(self.gain(speed))], [float(self.turn(speed))]])

    def transfer(self, speed: float) -> control.TransferFunction:
        """Return G(z) from steering to distance, (11)."""
        import control  # for the loci only: the gains are designed without it

        zero = float(self.zero(speed))
        return control.zpk([zero], [1.0, 1.0], float(self.gain(speed)), self.step)


def closed_poles(open_loop: control.TransferFunction, gain: float = 1.0) -> Floats:
    """Return the poles of the loop closed with ``gain``, largest real part first: one point of each branch."""
    import control

    poles = control.root_locus_map(open_loop, [gain]).loci[0]
    return np.asarray(sorted(poles, key=lambda pole: (-pole.real, pole.imag)))


@dataclass(frozen=True)
class PiDesign:
    """G_R = gain (z - zero)/(z - 1) and how it was found: `loop_gain` is k of k (z - n2)(z - n3)/(z - 1)³."""

    zero: Floats
    breakaway: Floats
    loop_gain: Floats
    gain: Floats


def pi_design(car: WallCar, speed: ArrayLike, beside: float = 0.025) -> PiDesign:
    """Return the PI of 3.3.3: zero left of the plant's, one closed pole ``beside`` the breakaway point (listing A.3).

    n2 = n3 - (1 - n3)/2. For three poles at 1 the breakaway point solves 3/(z - 1) = 1/(z - n2) + 1/(z - n3).
    """
    n3 = car.zero(speed)
    n2 = n3 - (1.0 - n3) / 2.0
    middle = n2 + n3 - 1.0
    breakaway = middle - np.sqrt(middle * middle - 3.0 * n2 * n3 + n2 + n3)
    pole = breakaway - beside
    loop_gain = np.abs((pole - 1.0) ** 3 / ((pole - n2) * (pole - n3)))
    return PiDesign(n2, breakaway, loop_gain, loop_gain / car.gain(speed))


#: Of `bounded_pi_design`: real part of the leftmost closed pole at the least, and the slow pole's distance from 1 in
#: those of the plant's zero at the least.
LEFTMOST, SLOWEST_SHARE = 0.1, 0.2


def bounded_pi_design(car: WallCar, speed: ArrayLike, beside: float = 0.025) -> PiDesign:
    """Return the PI of 3.3.3 for any speed: the published one, changed where that would put a pole left of zero.

    The report's rule is that no closed pole is left of zero at any speed; its own n2 breaks it above 1.13 m/s (pses:
    0.83), and above 2.7 m/s (1.99) that loop is unstable. Three closed poles leave the PI one condition,
    (p1 - n3)(p2 - n3)(p3 - n3) = (1 - n3)³. Here the leftmost pair stays at the real part 0.1, beside each other as in
    the report, and p3 follows. Once n3 is so small that p3 would come nearer to 1 than a fifth of 1 - n3, p3 stays
    there and the pair becomes complex. (From 2.59 m/s on, pses 1.91, n3 is below 1/2, and no PI has real positive
    poles alone.) Stable up to 6.2 m/s (4.5).
    """
    published, n3 = pi_design(car, speed, beside), car.zero(speed)
    middle, m = LEFTMOST + beside, 1.0 - n3
    with np.errstate(divide="ignore"):
        share = 1.0 - m * m / np.maximum((n3 - middle) ** 2 - beside**2, 0.0)
    slow = 1.0 - np.maximum(share, SLOWEST_SHARE) * m
    # Half of the pair's difference, squared: negative where it is complex.
    half = (middle - n3) ** 2 - m**3 / (slow - n3)
    gain = 3.0 - 2.0 * middle - slow
    zero = (3.0 - (middle**2 - half + 2.0 * middle * slow)) / gain - n3
    kept = published.breakaway - beside >= LEFTMOST
    return PiDesign(
        np.where(kept, published.zero, zero),
        np.where(kept, published.breakaway, middle),
        np.where(kept, published.loop_gain, gain),
        np.where(kept, published.gain, gain / car.gain(speed)),
    )


def pi_poles(car: WallCar, speed: float, design: PiDesign) -> Floats:
    """Return the closed poles of a PI (for this one speed) on the plant, largest real part first, (3,)."""
    n3 = float(car.zero(speed))
    opened = float(design.loop_gain) * np.poly([float(design.zero), n3])
    poles = np.roots(np.polyadd(np.poly([1.0, 1.0, 1.0]), opened))
    return np.asarray(sorted(poles, key=lambda pole: (-pole.real, pole.imag)))


def state_gains(car: WallCar, speed: ArrayLike, poles: ArrayLike = (0.7, 0.8, 0.9)) -> Floats:
    """Return (r1, r2, r3) of u = r1 w - r1 y - r2 phi - r3 x_I, x_I the sum of w - y: (17), shape (..., 3).

    The prefilter (18) is r1.
    """
    _, a2, a1, a0 = np.poly(np.asarray(poles))
    way = np.asarray(speed, dtype=np.float64) * car.step
    arm = car.sensor + way / 2.0
    at_one, slope = 1.0 + a0 + a1 + a2, 3.0 + a1 + 2.0 * a2
    r1 = way * slope - at_one * arm
    r2 = at_one * arm**2 - way * slope * arm + way**2 * (3.0 + a2)
    return np.asarray((car.wheelbase / way**3)[..., None] * np.stack([r1, r2, -way * at_one], axis=-1))


def state_plant(car: WallCar, speed: float) -> tuple[Floats, Floats]:
    """Return A (3, 3) and b (3, 1) of (13): y, phi and the sum of w - y, for Ackermann's formula."""
    a, b = car.plant(speed)
    augmented = np.eye(3)
    augmented[:2, :2], augmented[2, 0] = a, -1.0
    return augmented, np.vstack([b, [[0.0]]])


@dataclass(frozen=True)
class PdDesign:
    """u = gain (e - zero e_before): (24)."""

    gain: float
    zero: float


def pd_design(step: float = 0.045, proportional: float = 15.0, derivative: float = 15.0) -> PdDesign:
    """Return the competition's PD (23) as it was driven: gain (T K_P + K_D)/T.

    In degrees per metre it is stable; in rad per metre the loop has a pole at -14.
    """
    both = step * proportional + derivative
    return PdDesign(both / step, derivative / both)


def misprinted_pd_design(step: float = 0.045, proportional: float = 15.0, derivative: float = 15.0) -> PdDesign:
    """Return the PD as (24) and A.7.1 print it, gain 1/(T (T K_P + K_D)): Figures 3.39 and 3.40 were made with it."""
    both = step * proportional + derivative
    return PdDesign(1.0 / (step * both), derivative / both)


def pd_locus(car: WallCar, speed: float, design: PdDesign) -> control.TransferFunction:
    """Return the open loop of PD and plant."""
    import control

    return control.zpk([design.zero], [0.0], design.gain, car.step) * car.transfer(speed)
