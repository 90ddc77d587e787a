"""A car with a powertrain on a road: steering, throttle and brake, slope and wind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import require, shown
from lanekeep_env.physics import models
from lanekeep_env.physics.integrate import LARGEST_SPEED
from lanekeep_env.physics.load_transfer import LARGEST_ALONG
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.powertrain_parameters import Powertrain, powertrain_from
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.roads import RandomRoads, RoadSpec, SpeedSpec, speed_from
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.disturbances import bounds_from
from lanekeep_env.scenario.effects import Need, never
from lanekeep_env.scenario.lane_keep import LaneKeepScenario
from lanekeep_env.scenario.traffic import LARGEST_BACKWARDS
from lanekeep_env.sensing.faults import MANOEUVRE_SENSOR_SETS, SensorSets


def _slope_from(value: Any) -> tuple[float, float]:
    return bounds_from("slope", "rad", -0.3, 0.3, value)


def _wind_from(value: Any) -> tuple[float, float]:
    return bounds_from("wind", "m/s", -40.0, 40.0, value)


@dataclass(frozen=True)
class PoweredScenario(LaneKeepScenario):
    """A car with pedals: the fields of `LaneKeepScenario` with other defaults, and these.

    Attributes:
        powertrain: a name, or a mapping of `Powertrain`.
        slope: bounds (low, high) of the road's rise, rad, drawn once an episode, or one number.
        wind: the same of the headwind, m/s.
        reference_speed_error: of the running cost, m/s.
        friction_circle: whether what engine and brake take of the tyres' friction is lost to cornering: an axle gives
            sqrt(1 - u²) of its peak across, u the share taken along, of which anti-lock and traction control leave
            0.95 at the most (stated here; it lets the car be steered while it brakes).

    ``speed`` only says how far an episode goes; the car's own follows from its pedals.
    """

    vehicle: VehicleParameters = VEHICLES["passat"]
    road: RoadSpec = field(default_factory=lambda: RandomRoads(peak_curvature=0.004, design_speed=25.0))
    speed: SpeedSpec = field(default_factory=lambda: speed_from(20.0))
    max_steering_angle: float = 0.5
    start_lateral_error: float = 0.3
    start_course_error: float = 0.02
    reference_steering_rate: float = 0.2
    observation: str = "full"
    control_step: float = 0.02
    episode_steps: int = 3000
    tyre: str = "magic_formula"
    preview: int = 11
    powertrain: Powertrain = field(default_factory=Powertrain)
    slope: tuple[float, float] = (-0.03, 0.03)
    wind: tuple[float, float] = (-5.0, 5.0)
    reference_speed_error: float = 2.0
    friction_circle: bool = True

    _sensor_sets: ClassVar[SensorSets] = MANOEUVRE_SENSOR_SETS
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **LaneKeepScenario._readers,
        "powertrain": powertrain_from,
        "slope": _slope_from,
        "wind": _wind_from,
    }
    _needs: ClassVar[tuple[Need, ...]] = (
        *(need for need in LaneKeepScenario._needs if need.field != "cornering_drag"),
        Need("cornering_drag", "drag of the tyres in bends", "the pedals set the speed", never),
        Need(
            "powertrain.creep_speed",
            "speed at which creeping ends",
            "creep=0 does not creep",
            lambda s: s.powertrain.creep > 0.0,
        ),
    )

    def _check(self) -> None:
        if not isinstance(self.friction_circle, bool):
            raise ValueError(f"friction_circle={shown(self.friction_circle)} is not allowed: it must be True or False")
        require("reference_speed_error", self.reference_speed_error, "m/s", at_least=1e-3, at_most=1e3)
        super()._check()
        self.powertrain.check(self.vehicle.mass * self.occurring.mass[0])
        if self.dynamics != "dynamic" or self.tyre == "linear":
            raise ValueError(
                f"dynamics={self.dynamics!r} with tyre={self.tyre!r} is not allowed: the car with a powertrain is "
                "'dynamic' on 'magic_formula' or 'load_sensitive' tyres"
            )

    @property
    def model(self) -> models.CarModel:
        """The vehicle model."""
        return models.LOAD_SENSITIVE_POWERED if self.tyre == "load_sensitive" else models.POWERED

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        return {
            **super().numbers(),
            at.SLOPE_LOW: np.sin(self.slope),
            at.WIND_LOW: self.wind,
            at.SPEED_REFERENCE: self.reference_speed_error,
            at.SECOND: (at.PEDAL, -1.0, 1.0),
            at.CIRCLE: LARGEST_ALONG if self.friction_circle else 0.0,
        }

    def _slowest(self) -> float:
        """It stops."""
        return 0.0

    @property
    def _fastest(self) -> float:
        return LARGEST_SPEED

    @property
    def sets_speed(self) -> bool:
        """The pedals do."""
        return False

    @property
    def num_actions(self) -> int:
        """Steering and pedal."""
        return 2

    def _channels(self) -> list[Channel]:
        return [
            *(replace(c, low=-2.0 * LARGEST_BACKWARDS) if c.name == "speed" else c for c in super()._channels()),
            Channel("acceleration", "m/s²", -20.0, 20.0, "longitudinal", at.PULL),
            Channel(
                "pedal", "", -1.0, 1.0, "what was asked for: throttle where positive, brake where negative", at.PEDAL
            ),
            Channel("gear", "", -1.0, 7.0, "0 for the first, -1 for reverse", at.GEAR),
            Channel("set_speed", "m/s", -LARGEST_BACKWARDS, 100.0, "asked for, negative backwards", at.SET_SPEED),
        ]
