"""Team KnightRiders 2017: the controllers along a wall in time, as pure steps over rows.

A step takes what was measured, the wanted distance and a memory, and returns the steering and the next memory; nothing
is remembered in the objects, and everything is elementwise over the rows.

Angles are in the unit of the design, whatever it is: radians, or degrees for gains in degrees per metre. So is the
steering limit, which a controller must know to keep its integrator from winding up: clamping, the sum stands still
while the steering is at its limit. inf is no limit.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.wall_cascade import CascadeDesign, published_cascade, redesigned_cascade
from lanekeep_baselines.wall_design import PdDesign, WallCar, bounded_pi_design, pi_design, state_gains


class Measured(NamedTuple):
    """What the controllers read, (n,) each: speed, m/s; distance of the sensor, m; heading; heading gained in a step.

    The last is yaw rate times step, over the step that just ended.
    """

    speed: Floats
    distance: Floats
    heading: Floats
    turned: Floats


class WallControl:
    """A controller for a car and a steering limit; subclasses write `command`."""

    memory: ClassVar[int] = 1

    def __init__(self, car: WallCar, limit: float) -> None:
        self.car, self.limit = car, limit

    def command(
        self, at: Measured, wanted: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats]:
        """Return the steering, (n,), within the limit, and the next memory, (n, memory).

        Args:
            at: the measurements.
            wanted: distance asked for, m, (n,).
            memory: (n, memory); never written to.
            fresh: rows that start, (n,), or one answer for all; their memory is zero.
        """
        raise NotImplementedError

    def _limited(self, steering: Floats) -> Floats:
        return np.clip(steering, -self.limit, self.limit)

    def _sum(self, total: Floats, error: Floats, asked: Floats, given: Floats) -> Floats:
        """Return the next sum of errors, (n, 1): it stands still where the steering was limited."""
        return np.where(asked == given, total + error, total)[:, None]


class Pi(WallControl):
    """First approach (3.3): u = k e + k (1 - n2) (sum of the errors before); as published, or bounded to any speed."""

    def __init__(self, car: WallCar, limit: float, bounded: bool = False) -> None:
        super().__init__(car, limit)
        self._design = bounded_pi_design if bounded else pi_design

    def command(
        self, at: Measured, wanted: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats]:
        design = self._design(self.car, at.speed)
        error, total = wanted - at.distance, np.where(fresh, 0.0, memory[:, 0])
        asked = design.gain * (error + (1.0 - design.zero) * total)
        given = self._limited(asked)
        return given, self._sum(total, error, asked, given)


class PiState(WallControl):
    """Second approach (3.4): state feedback with integrator and prefilter, which winds up."""

    def command(
        self, at: Measured, wanted: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats]:
        gains = state_gains(self.car, at.speed)
        error, total = wanted - at.distance, np.where(fresh, 0.0, memory[:, 0])
        asked = gains[:, 0] * error - gains[:, 1] * at.heading - gains[:, 2] * total
        return self._limited(asked), (total + error)[:, None]


class PublishedCascade(WallControl):
    """Third approach (3.5) with the yaw rate of this very step, v/l times the steering: the algebraic loop solved.

    No car can measure it: for the authors' simulation only. With ``delayed`` the loop is closed on the measured yaw
    rate, as on a car: then the steering chatters between its limits.
    """

    def __init__(
        self, car: WallCar, limit: float, distance_gain: float, delayed: bool = False, gain_speed: float | None = None
    ) -> None:
        super().__init__(car, limit)
        self._distance_gain, self._delayed, self._gain_speed = distance_gain, delayed, gain_speed

    def command(
        self, at: Measured, wanted: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats]:
        falls = 1.0 if self._gain_speed is None else self._gain_speed / at.speed
        design = published_cascade(self.car, at.speed, self._distance_gain * falls)
        turn, total = self.car.turn(at.speed), np.where(fresh, 0.0, memory[:, 0])
        rear = at.distance - self.car.sensor * at.heading
        rate = design.heading_gain * (design.distance_gain * (wanted - rear) - at.heading)
        integral = design.rate_gain * (1.0 - design.rate_zero) * total
        if self._delayed:
            asked = design.rate_gain * (rate - at.turned) + integral
        else:
            asked = (design.rate_gain * rate + integral) / (1.0 + design.rate_gain * turn)
        given = self._limited(asked)
        error = rate - (at.turned if self._delayed else turn * given)
        return given, self._sum(total, error, asked, given)


class Cascade(WallControl):
    """The third approach redesigned for a yaw rate one sample late (`wall_cascade`); radians, ``largest_heading`` too.

    Its memory is the last steering: what it adds up is bounded by what the car can steer.
    """

    def __init__(self, car: WallCar, limit: float, largest_heading: float) -> None:
        super().__init__(car, limit)
        self._largest_heading = largest_heading

    def design(self, speed: Floats) -> CascadeDesign:
        """Return the gains at ``speed`` (n,)."""
        return redesigned_cascade(self.car, speed)

    def command(
        self, at: Measured, wanted: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats]:
        design = self.design(at.speed)
        rear = at.distance - self.car.sensor * at.heading
        heading = np.clip(design.distance_gain * (wanted - rear), -self._largest_heading, self._largest_heading)
        rate = design.heading_gain * (heading - at.heading)
        last = np.where(fresh, 0.0, memory[:, 0])
        given = self._limited(last + design.rate_gain * (rate - at.turned))
        return given, given[:, None]


class Pd(WallControl):
    """The competition's PD (3.6), for one speed; without an integrator a steering offset leaves an error.

    With ``kick`` the error before the start is zero, as in the step response of the transfer function; else it is that
    at the start.
    """

    def __init__(self, car: WallCar, limit: float, design: PdDesign, kick: bool = False) -> None:
        super().__init__(car, limit)
        self._design, self._kick = design, kick

    def command(
        self, at: Measured, wanted: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats]:
        error = wanted - at.distance
        before = np.where(fresh, 0.0 if self._kick else error, memory[:, 0])
        return self._limited(self._design.gain * (error - self._design.zero * before)), error[:, None]
