"""Team KnightRiders' wall-following controllers as policies, each in radians (`si`) and as it was driven.

The report's gains are numbers per unit of the angle, and its simulations put metres and degrees into the same matrices.
`as-driven` is what such a gain is on a car: degrees of steering per metre of distance, 57 times less than designed,
while headings in degrees weigh as much as they should. Designs and sources: `wall_design`, `wall_cascade`.

State feedback and cascade need a heading, which the car does not measure: they take the channel `heading_error` of
`observation="full"`. The missing piece that the authors name, a Kalman filter, is in `knightriders-cascade-kalman`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats, Scenario, SteeringPolicy
from lanekeep_baselines.wall_cascade import (
    DISTANCE_GAIN_DEGREES,
    DISTANCE_GAIN_RADIANS,
    DISTANCE_GAIN_SPEED,
    LARGEST_HEADING,
)
from lanekeep_baselines.wall_control import Cascade, Measured, Pd, Pi, PiState, PublishedCascade, WallControl
from lanekeep_baselines.wall_design import WallCar, pd_design
from lanekeep_baselines.wall_estimator import WallFilter

_DEGREE = float(np.pi / 180.0)
#: Gains exist at no standstill: below this speed those for it are used, m/s.
SLOWEST = 0.2


class WallScenario(Scenario, Protocol):
    """What a wall-following controller may know besides; `lanekeep_env.WallFollowScenario` is one."""

    @property
    def set_distance(self) -> float: ...
    @property
    def side_sensor_place(self) -> float: ...


def wall_car(scenario: WallScenario) -> WallCar:
    """Return what the designs know of the scenario's car."""
    return WallCar(scenario.vehicle.wheelbase, scenario.side_sensor_place, scenario.control_step)


class WallPolicy(SteeringPolicy):
    """A `WallControl` on the channels; subclasses make it."""

    reads: ClassVar[tuple[str, ...]] = ("distance_right", "speed", "heading_error", "yaw_rate")
    #: Whether the gains are in degrees per metre.
    driven: ClassVar[bool] = False

    def __init__(self, scenario: WallScenario) -> None:
        super().__init__(scenario)
        self._unit = _DEGREE if self.driven else 1.0
        self._wanted, self._step = scenario.set_distance, scenario.control_step
        self._control = self.make(wall_car(scenario), scenario.max_steering_angle / self._unit)
        self.memory = self._control.memory + 1  # and the last distance, for steps without an echo

    def make(self, car: WallCar, limit: float) -> WallControl:
        """Return the controller for a car and a steering limit in the unit of the gains."""
        raise NotImplementedError

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        heard = at["distance_right"] > 0.0
        distance = np.where(heard, at["distance_right"], np.where(fresh, self._wanted, memory[:, -1]))
        measured = Measured(
            np.maximum(at["speed"], SLOWEST),
            distance,
            at.get("heading_error", 0.0 * distance) / self._unit,
            at.get("yaw_rate", 0.0 * distance) * self._step / self._unit,
        )
        wanted = np.full_like(distance, self._wanted)
        steering, following = self._control.command(measured, wanted, memory[:, :-1], fresh)
        return steering * self._unit, np.concatenate([following, distance[:, None]], axis=1)


class KnightRidersPi(WallPolicy):
    """`knightriders-pi`: PI by root locus (3.3), gains recomputed with the speed.

    Up to 1.0 m/s (pses: 0.7) as published, above by `bounded_pi_design`: no pole left of zero at any speed, as the
    report itself asks, and stable up to 6 m/s (pses: 4.5).
    """

    name = "knightriders-pi"
    reads = ("distance_right", "speed")

    def make(self, car: WallCar, limit: float) -> WallControl:
        return Pi(car, limit, bounded=not self.driven)


class KnightRidersPiAsDriven(KnightRidersPi):
    """`knightriders-pi-as-driven`: the published gains in degrees per metre."""

    name = "knightriders-pi-as-driven"
    driven = True


class KnightRidersPiState(WallPolicy):
    """`knightriders-pi-state`: PI state feedback (3.4), poles 0.7, 0.8, 0.9; winds up at the steering limit."""

    name = "knightriders-pi-state"

    def make(self, car: WallCar, limit: float) -> WallControl:
        return PiState(car, limit)


class KnightRidersPiStateAsDriven(KnightRidersPiState):
    """`knightriders-pi-state-as-driven`: the same gains in degrees per metre."""

    name = "knightriders-pi-state-as-driven"
    driven = True


class KnightRidersCascadePublished(WallPolicy):
    """`knightriders-cascade-published`: the cascade (3.5) with its loop gain of 17, on the measured yaw rate.

    One sample of delay makes the inner loop chatter between the steering limits; the report's simulation solved it as
    an algebraic loop.
    """

    name = "knightriders-cascade-published"

    def make(self, car: WallCar, limit: float) -> WallControl:
        gain = DISTANCE_GAIN_DEGREES if self.driven else DISTANCE_GAIN_RADIANS
        return PublishedCascade(car, limit, gain, delayed=True, gain_speed=DISTANCE_GAIN_SPEED)


class KnightRidersCascadeAsDriven(KnightRidersCascadePublished):
    """`knightriders-cascade-as-driven`: the same with angles in degrees."""

    name = "knightriders-cascade-as-driven"
    driven = True


class KnightRidersCascade(WallPolicy):
    """`knightriders-cascade`: the cascade redesigned for one sample of delay, in radians."""

    name = "knightriders-cascade"

    def make(self, car: WallCar, limit: float) -> WallControl:
        return Cascade(car, limit, LARGEST_HEADING)


class KnightRidersPd(WallPolicy):
    """`knightriders-pd`: the competition's PD (3.6) in rad per metre, which is unstable."""

    name = "knightriders-pd"
    reads = ("distance_right", "speed")

    def make(self, car: WallCar, limit: float) -> WallControl:
        return Pd(car, limit, pd_design(car.step))


class KnightRidersPdAsDriven(KnightRidersPd):
    """`knightriders-pd-as-driven`: the competition's PD in degrees per metre: the controller that drove."""

    name = "knightriders-pd-as-driven"
    driven = True


class KnightRidersCascadeKalman(SteeringPolicy):
    """`knightriders-cascade-kalman`: the redesigned cascade on a Kalman filter for heading and biases.

    Extension: the filter that the authors name as the missing piece (3.5.7) takes the side distance, the yaw rate, the
    speed and the last steering; its steering offset is taken off the command, its yaw-rate bias off the measurement.
    """

    name = "knightriders-cascade-kalman"
    reads = ("distance_right", "speed", "yaw_rate", "steering_command")

    def __init__(self, scenario: WallScenario) -> None:
        super().__init__(scenario)
        car = wall_car(scenario)
        self._wanted, self._step = scenario.set_distance, scenario.control_step
        self._filter = WallFilter(car)
        self._control = Cascade(car, scenario.max_steering_angle, LARGEST_HEADING)
        self.memory = self._filter.memory + self._control.memory

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        speed, split = at["speed"], self._filter.memory
        known = self._filter.update(
            memory[:, :split], fresh, speed, at["steering_command"], at["distance_right"], at["yaw_rate"]
        )
        turned = (at["yaw_rate"] - known[:, 3]) * self._step
        measured = Measured(np.maximum(speed, SLOWEST), known[:, 0], known[:, 1], turned)
        wanted = np.full_like(speed, self._wanted)
        steering, following = self._control.command(measured, wanted, memory[:, split:], fresh)
        return steering, np.concatenate([known, following], axis=1)
