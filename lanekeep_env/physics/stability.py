"""Whether RK4 can integrate a car: the linear single track's eigenvalues against the method's region of stability.

With x = (sideslip, yaw rate), x' = A x is what both tyre models are while they slip little; the magic formula has the
linear tyre's slope at zero slip and is nowhere steeper. A's eigenvalues grow with stiffness over mass and inertia and
fall with the speed down to the slip-speed floor, so that light, stiff and slow cars want shorter steps.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.physics.load_transfer import numbers_of, on_loads, read
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.single_track import SLIP_SPEED_FLOOR
from lanekeep_env.randomisation import Randomisation

Floats = NDArray[np.float64]

#: |eigenvalue| times step that a step bears. RK4 damps every mode with Re z <= 0 and |z| < 2.616, real ones to 2.785.
LARGEST_PRODUCT = 2.5
#: Turn of a rolling car in a step that is borne, rad.
LARGEST_TURN = 0.5
#: Into how many steps one is divided at the most.
MOST_DIVISIONS = 16
#: Share by which the slip-speed floor may widen a steady circle.
FLOOR_ERROR = 0.009


@dataclass(frozen=True)
class Cars:
    """The cars at the corners of what a randomisation draws; arrays (k,), units as in `VehicleParameters`."""

    mass: Floats
    yaw_inertia: Floats
    front: Floats
    rear: Floats
    front_stiffness: Floats
    rear_stiffness: Floats

    @classmethod
    def drawn(cls, vehicle: VehicleParameters, drawn: Randomisation) -> Self:
        """All combinations of lowest and highest mass, stiffnesses and place of the centre of gravity."""
        corners = itertools.product(
            drawn.mass, drawn.front_cornering_stiffness, drawn.rear_cornering_stiffness, drawn.cg_shift
        )
        mass, front, rear, shift = np.array(list(corners)).T
        return cls(
            mass * vehicle.mass,
            mass * vehicle.yaw_inertia,
            vehicle.cg_to_front_axle - shift,
            vehicle.cg_to_rear_axle + shift,
            front * vehicle.front_cornering_stiffness,
            rear * vehicle.rear_cornering_stiffness,
        )

    def on_loads(self, vehicle: VehicleParameters, pulls: Iterable[float]) -> Self:
        """The same cars straight on, with what their masses and accelerations ``pulls`` (m/s²) make of their tyres."""
        one = np.ones_like(self.mass)
        axles = self.front, self.rear, 1.0 / self.mass, 1.0 / self.yaw_inertia
        body = (*axles, self.front_stiffness, self.rear_stiffness, one, one, None)
        numbers = read(numbers_of(vehicle))
        cars = [on_loads(body, one, (one, one), pull * one, 0.0 * one, numbers)[4:6] for pull in pulls]
        front, rear = (np.concatenate(stiffness) for stiffness in zip(*cars, strict=True))
        mass, inertia, ahead, behind = (
            np.tile(row, len(cars)) for row in (self.mass, self.yaw_inertia, self.front, self.rear)
        )
        return type(self)(mass, inertia, ahead, behind, front, rear)

    @property
    def understeer_gradient(self) -> Floats:
        """K of the steady circle r = v delta / (l + K v²), s²/m."""
        base = self.front + self.rear
        return self.mass / base * (self.rear / self.front_stiffness - self.front / self.rear_stiffness)

    def slip_speed_floor(self) -> float:
        """Speed below which the slip angles are those of this speed, m/s (see `single_track`).

        A car that goes slower turns as if it went that fast, r = v delta / (l + K floor²): the floor is lowered where
        that would be off by more than `FLOOR_ERROR`.
        """
        steepest = float(np.max(np.abs(self.understeer_gradient) / (self.front + self.rear)))
        return (
            SLIP_SPEED_FLOOR if steepest <= FLOOR_ERROR else SLIP_SPEED_FLOOR * float(np.sqrt(FLOOR_ERROR / steepest))
        )

    def largest_eigenvalue(self, slowest: float, fastest: float, floor: float) -> float:
        """Largest |eigenvalue| of any of the cars at any speed from ``slowest`` to ``fastest`` (m/s), 1/s."""
        low = max(slowest, 0.1 * floor)
        speeds = np.geomspace(low, max(fastest, low), 33)
        v = np.concatenate([speeds, [slowest, np.clip(floor, slowest, max(fastest, slowest))]])[:, None]
        floored = np.maximum(v, floor)
        stiffness, moment = self.front_stiffness + self.rear_stiffness, self._moment
        turning = self.front**2 * self.front_stiffness + self.rear**2 * self.rear_stiffness
        a11 = -stiffness * v / (self.mass * floored**2)
        a12 = moment / (self.mass * floored**2) - 1.0
        a21 = moment * v / (self.yaw_inertia * floored)
        a22 = -turning / (self.yaw_inertia * floored)
        middle, apart = 0.5 * (a11 + a22), 0.25 * (a11 - a22) ** 2 + a12 * a21
        real = np.abs(middle) + np.sqrt(np.maximum(apart, 0.0))
        return float(np.where(apart >= 0.0, real, np.sqrt(middle**2 - np.minimum(apart, 0.0))).max())

    @property
    def _moment(self) -> Floats:
        return self.rear * self.rear_stiffness - self.front * self.front_stiffness
