"""Our cars as vehicles of highway-env."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from highway_env.vehicle.kinematics import Vehicle

from lanekeep_env import layout as at
from lanekeep_env.adapters.highway.axes import Floats, mirrored, turned
from lanekeep_env.adapters.highway.plant import Plant
from lanekeep_env.physics.single_track import kinematic

#: Of rates that do not depend on them: where the car is.
_NOWHERE = (0.0, 0.0)


class EgoVehicle(Vehicle):
    """A car of ours on a road of theirs; `of` makes the class for a plant, as highway-env wants classes.

    ``position`` is the centre of gravity's; ``speed`` that along the course, of a rolling car the rear axle's; all
    attributes that highway-env knows have its signs and units, and may be set between two steps. What it does not
    know (sideslip, yaw rate, the road wheel, commands on their way) is in ``car``, in ours.
    """

    plant: ClassVar[Plant]
    MIN_SPEED = 0.0
    position: Floats
    heading: float
    speed: float
    impact: Any

    @classmethod
    def of(cls, plant: Plant) -> type[EgoVehicle]:
        """Return the class of a plant's cars."""
        body = plant.scenario.vehicle
        return type(cls.__name__, (cls,), {"plant": plant, "LENGTH": body.length, "WIDTH": body.width})

    def __init__(self, road: Any, position: Any, heading: float = 0.0, speed: float = 0.0, *others: Any) -> None:
        super().__init__(road, position, heading, speed, *others)
        body = self.plant.scenario.vehicle
        # Of the body ahead of the centre of gravity, m: overhangs are taken to be equal.
        self._middle = 0.5 * (body.cg_to_front_axle - body.cg_to_rear_axle)
        self.diagonal += 2.0 * abs(self._middle)
        self.car = self.plant.new()

    def step(self, dt: float) -> None:
        """Advance by a simulation step.

        Raises:
            ValueError: ``dt`` is not the step that the car was made for.
        """
        if abs(dt - self.plant.scenario.control_step) > 1e-9:
            raise ValueError(f"dt={dt!r} is not allowed: this car was made for {self.plant.scenario.control_step!r} s")
        self.clip_actions()
        car = self.car
        car[at.ALONG, 0], car[at.LATERAL, 0] = mirrored(self.position)
        car[at.HEADING, 0], car[at.SPEED, 0] = turned(self.heading), self.speed
        self.plant.drive(car, turned(self.action["steering"]), self.action["acceleration"], self.MAX_SPEED)
        self.position = mirrored((car[at.ALONG, 0], car[at.LATERAL, 0]))
        self.heading, self.speed = turned(float(car[at.HEADING, 0])), float(car[at.SPEED, 0])
        if self.impact is not None:
            self.position += self.impact
            self.crashed, self.impact = True, None
        self.on_state_update()

    @property
    def velocity(self) -> Floats:
        """Of the centre of gravity along its course, m/s, (2,)."""
        course = self.heading + turned(float(self.car[at.SIDESLIP, 0]))
        return self._course_speed * np.array([math.cos(course), math.sin(course)])

    @property
    def lateral_speed(self) -> float:
        """Of the centre of gravity across the car's axis, m/s."""
        return self._course_speed * math.sin(turned(float(self.car[at.SIDESLIP, 0])))

    @property
    def yaw_rate(self) -> float:
        """Of the heading, rad/s."""
        return turned(float(self.car[at.YAW_RATE, 0]))

    @property
    def _course_speed(self) -> float:
        # Of a rolling car ``speed`` is the rear axle's.
        slips = self.plant.scenario.model.slips
        return self.speed if slips else self.speed / math.cos(float(self.car[at.SIDESLIP, 0]))

    @property
    def state(self) -> Floats:
        """Position, heading, speed, lateral speed and yaw rate, (6, 1), as `BicycleVehicle` has them."""
        numbers = (*self.position, self.heading, self.speed, self.lateral_speed, self.yaw_rate)
        return np.array(numbers, dtype=np.float64)[:, None]

    @property
    def derivative(self) -> Floats:
        """Rates of `state`, (6, 1); of a rolling car those of the last two are 0."""
        car, rates = self.car[:, 0], self.plant.scenario.model.rates
        beta, v = float(car[at.SIDESLIP]), self.speed
        given = (float(car[row]) for row in (at.SIDESLIP, at.YAW_RATE, at.STEER))
        body = tuple(car[at.CAR : at.CAR + at.CAR_SIZE].tolist())
        acceleration = float(self.action["acceleration"])
        across = yaw = 0.0
        if rates is not kinematic:
            _, _, _, beta_rate, yaw = rates(*_NOWHERE, *given, v, 0.0, (*body, self.plant.floor))
            across = acceleration * math.sin(beta) + v * math.cos(beta) * beta_rate
        numbers = (*self.velocity, self.yaw_rate, acceleration, turned(across), turned(yaw))
        return np.array(numbers, dtype=np.float64)[:, None]

    def polygon(self) -> Floats:
        """Corners of the body, the first one twice, m, (5, 2)."""
        corners: Floats = super().polygon() + self._middle * self.direction
        return corners

    def predict_trajectory_constant_speed(self, times: Any) -> Any:
        """What other vehicles expect of this one, by highway-env's own model."""
        return Vehicle.create_from(self).predict_trajectory_constant_speed(times)
