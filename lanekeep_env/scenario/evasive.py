"""Evasive manoeuvres and paths driven backwards (Werling, Gröll, Bretthauer 2008)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

from lanekeep_env import layout as at
from lanekeep_env.checks import require
from lanekeep_env.physics import models
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.roads import EvasiveRoads, ParkingPaths, RoadSpec, SetSpeeds, SpeedSpec, set_speeds_from, speed_from
from lanekeep_env.scenario.base import Channel, Measured, steering_channels
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.lane_keep import PREVIEW_INTERVAL, LaneKeepScenario
from lanekeep_env.scenario.road import RoadScenario
from lanekeep_env.sensing.faults import MANOEUVRE_SENSOR_SETS, SensorSets


@dataclass(frozen=True)
class EvasiveScenario(LaneKeepScenario):
    """`lanekeep/Evasive-v0`: an evasive path at 55 km/h on saturating tyres, from up to 0.8 m beside it."""

    vehicle: VehicleParameters = VEHICLES["passat"]
    road: RoadSpec = field(default_factory=EvasiveRoads)
    speed: SpeedSpec = field(default_factory=lambda: speed_from(55.0 / 3.6))
    max_steering_angle: float = 0.5
    start_lateral_error: float = 0.8
    start_course_error: float = 0.0
    lane_width: float = 4.0
    reference_steering_rate: float = 0.3
    observation: str = "full"
    control_step: float = 0.02
    episode_steps: int = 300
    tyre: str = "magic_formula"
    preview: int = 11
    view: ClassVar[float] = 80.0

    _sensor_sets: ClassVar[SensorSets] = MANOEUVRE_SENSOR_SETS


@dataclass(frozen=True)
class ReversePathScenario(RoadScenario):
    """`lanekeep/ReversePath-v0`: a path with bends near the car's turning circle, driven backwards at walking speed.

    The fields of `RoadScenario` and these; errors are the REAR AXLE's.

    Attributes:
        speed: backwards, m/s, or a mapping of `SetSpeeds`; a negative ``minimum`` lets the car drive forwards at times.
        preview: number of curvature samples in the observation, the first one at the car; ahead is where it is going,
            towards the path's start.
        preview_interval: time between preview samples at the present speed, s.
    """

    vehicle: VehicleParameters = VEHICLES["passat"]
    road: RoadSpec = field(default_factory=ParkingPaths)
    speed: SetSpeeds = field(
        default_factory=lambda: SetSpeeds(0.5, 1.5, hold=None, standstill=0.0, lateral_acceleration=None)
    )
    max_steering_angle: float = 0.6
    start_lateral_error: float = 0.2
    start_course_error: float = math.radians(3.0)
    lane_width: float = 3.0
    reference_lateral_error: float = 0.1
    reference_steering_rate: float = 0.3
    control_step: float = 0.02
    episode_steps: int = 1500
    preview: int = 11
    preview_interval: float = 0.1
    view: ClassVar[float] = 30.0
    largest_observed_speed: ClassVar[float] = 20.0
    both_ways: ClassVar[bool] = True

    _sensor_sets: ClassVar[SensorSets] = MANOEUVRE_SENSOR_SETS
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **RoadScenario._readers,
        "speed": set_speeds_from,
    }
    _needs: ClassVar[tuple[Need, ...]] = (*RoadScenario._needs, PREVIEW_INTERVAL)

    def _check(self) -> None:
        require("preview", self.preview, "samples", at_least=0, at_most=1000, whole=True)
        require("preview_interval", self.preview_interval, "s", at_least=1e-4, at_most=60.0)
        super()._check()

    @property
    def model(self) -> models.CarModel:
        """The vehicle model."""
        return models.KINEMATIC_PACED

    @property
    def slows_for_bends(self) -> bool:
        """Only in where episodes start: backwards the car does not know of bends before it is in them."""
        return not self.road.from_start

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        preview = {at.PREVIEW: self.preview, at.PREVIEW_TIME: self.preview_interval}
        return {**super().numbers(), **preview, at.BACKWARDS: 1.0}

    @property
    def axles(self) -> tuple[float, float]:
        """The reference point is the rear axle."""
        return self.vehicle.wheelbase, 0.0

    def _channels(self) -> list[Channel]:
        seen = Measured()
        channels = [
            Channel(
                "lateral_error",
                "m",
                -20.0,
                20.0,
                "rear axle left of the path, as seen along the path",
                at.LATERAL,
                seen,
            ),
            Channel(
                "heading_error", "rad", -math.pi, math.pi, "heading minus the path's, left positive", at.HEADING, seen
            ),
            Channel("yaw_rate", "rad/s", -4.0, 4.0, "left positive", at.YAW_RATE, seen),
            Channel("speed", "m/s", -20.0, 20.0, "of the rear axle, negative backwards", at.SPEED, seen),
            *steering_channels(),
        ]
        for k in range(self.preview):
            where = f"{k * self.preview_interval:g} s on, backwards" if k else "at the rear axle"
            channels.append(self._curvature(f"curvature_preview_{k}", f"of the path {where}, left positive"))
        if self.observation == "full":
            channels += [
                Channel("sideslip", "rad", -math.pi, math.pi, "none at the rear axle", at.SIDESLIP),
                self._curvature("curvature", "of the path at the rear axle, left positive", at.CURVATURE_HERE),
                Channel(
                    "lateral_acceleration", "m/s²", -50.0, 50.0, "of the rear axle, left positive", at.ACCELERATION
                ),
            ]
        return channels
