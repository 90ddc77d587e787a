"""Our cars in the plane, as records and arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lanekeep_env import layout as at
from lanekeep_env.adapters.highway.plane import KINEMATIC_DRIVEN, kernels
from lanekeep_env.families.road.cars import RoadCars
from lanekeep_env.physics.models import POWERED, CarModel
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.scenario import LaneKeepScenario

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FreeScenario(LaneKeepScenario):
    """A car that is told an acceleration, on no road: on a straight one without curvature, s, d and theta are x, y and
    heading. Its control step is the other world's simulation step."""

    @property
    def model(self) -> CarModel:
        """The vehicle model."""
        return POWERED if super().model.saturates else KINEMATIC_DRIVEN

    def _check(self) -> None:
        super()._check()
        if self.disturbed:
            raise ValueError(
                "gain and offset of the steering, and what else disturbs a car, are not allowed in that world; "
                "allowed: gain 1 and offset 0"
            )

    def _slowest(self) -> float:
        return 0.0


class Plant:
    """What all cars of a scenario share; a car itself is a block (rows of `layout`, 1)."""

    def __init__(self, scenario: FreeScenario) -> None:
        cars = RoadCars(scenario, 1, "float64")
        self.scenario = scenario
        self._settings, (_, self._gear, self.floor, *_) = cars.settings, cars.equipment
        #: Largest acceleration, m/s²: no tyre gives more than friction times load.
        self.grip = scenario.friction * GRAVITY if scenario.model.slips else math.inf
        fill, self._drive = kernels(scenario.model)
        self._new = cars.cars[0].copy()
        fill(self._new, self._settings)

    def new(self) -> Floats:
        """Return a car that rolls straight on with its wheels straight."""
        return self._new.copy()

    def drive(self, car: Floats, command: float, acceleration: float, fastest: float) -> None:
        """Take a car through one control step.

        Args:
            car: what `new` returned, in place.
            command: of the road wheel, rad, left positive; clipped to what can be commanded.
            acceleration: m/s²; of a car with tyres clipped to friction times gravity.
            fastest: m/s. It does not go backwards.
        """
        limit, grip = self.scenario.largest_angle, self.grip
        car[at.COMMAND, 0] = min(max(command, -limit), limit)
        car[at.PULL, 0] = min(max(acceleration, -grip), grip)
        car[at.SPEED_TARGET, 0] = fastest
        self._drive(car, self._settings, self._gear, self.floor)
