"""Lane keeping and road works: scenarios of cars that follow a lane at a road's speed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, require, shown
from lanekeep_env.physics import models
from lanekeep_env.physics.integrate import HELD
from lanekeep_env.physics.load_transfer import numbers_of
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.randomisation import FRICTION_SHARE
from lanekeep_env.roads import (
    FileSpeed,
    LimitedSpeed,
    RoadSpec,
    RoadWorksRoads,
    SpeedSpec,
    lap_time,
    road_set,
    speed_from,
)
from lanekeep_env.scenario.base import Channel, Measured, steering_channels
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.road import RoadScenario

_MODELS = {
    ("kinematic", "linear"): models.KINEMATIC,
    ("kinematic", "magic_formula"): models.KINEMATIC,
    ("dynamic", "linear"): models.LINEAR,
    ("dynamic", "magic_formula"): models.MAGIC_FORMULA,
    ("kinematic", "load_sensitive"): models.KINEMATIC,
    ("dynamic", "load_sensitive"): models.LOAD_SENSITIVE,
}
#: The same with cornering drag.
_HELD = {models.MAGIC_FORMULA: models.MAGIC_FORMULA_HELD, models.LOAD_SENSITIVE: models.LOAD_SENSITIVE_HELD}

#: Kinds of tyres.
TYRES = ("linear", "magic_formula", "load_sensitive")
#: Steering that a road asks for by default, rad: usual, widest, and the margin to its sharpest curve.
_USUAL, _WIDEST, _MARGIN = 0.15, 1.2, 1.5
#: How much longer a lap takes than the profile of its centre.
_OUTSIDE = 1.03


def steering_range(wheelbase: float, curvature: float) -> float:
    """Steering angle that action 1 asks for by default, rad: the usual, or more where a curvature (1/m) takes more."""
    return round(max(_USUAL, min(_MARGIN * math.atan(wheelbase * curvature), _WIDEST)), 3)


PREVIEW_INTERVAL = Need(
    "preview_interval",
    "time between preview samples",
    "it takes two samples, preview >= 2, the first one is at the car",
    lambda s: s.preview >= 2,
)


@dataclass(frozen=True)
class LaneKeepScenario(RoadScenario):
    """Everything that defines `lanekeep/LaneKeep-v0`; every field is a keyword of ``gym.make``.

    The fields of `RoadScenario` and these:

    Attributes:
        speed: m/s, a mapping of `LimitedSpeed`, or "file" for what the road's file gives; 0.4 g of lateral acceleration
            and 180 km/h by default.
        dynamics: "dynamic" (sideslip and tyres) or "kinematic" (no slip).
        tyre: "linear", "magic_formula" (saturates at friction times load) or "load_sensitive"; dynamic car only. The
            last one is honest at the limit: load transfer, friction and stiffness that fall with load, combined slip
            (see `load_transfer`), and a speed profile within the friction ellipse.
        cornering_drag: whether the tyres' drag in bends slows the car down; a driver then holds the profile's speed,
            who makes up for what is missing in 1 s. Otherwise the profile's speed is imposed. Saturating tyres only.
        friction: road friction coefficient; saturating tyres only.
        preview: number of curvature samples in the observation, the first one at the car.
        preview_interval: time between preview samples at the present speed, s.
        max_steering_angle: by default 0.15 rad, or half as much again as the road's sharpest curve asks for (to a
            thousandth, 1.2 rad at the most), whichever is more.
    """

    max_steering_angle: float = None  # type: ignore[assignment]  # a number once the road is known

    dynamics: str = "dynamic"
    tyre: str = "linear"
    cornering_drag: bool = False
    friction: float = 1.0
    preview: int = 0
    preview_interval: float = 0.1

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **RoadScenario._readers,
        "speed": speed_from,
    }
    _needs: ClassVar[tuple[Need, ...]] = (
        *RoadScenario._needs,
        PREVIEW_INTERVAL,
        Need("tyre", "kind of tyre", "a kinematic car rolls without slip, it has no tyres", lambda s: s.model.slips),
        Need(
            "friction",
            "the road's friction coefficient",
            "only saturating tyres know it: tyre='magic_formula' with dynamics='dynamic'",
            lambda s: s.model.saturates,
        ),
        Need(
            "cornering_drag",
            "drag of the tyres in bends",
            "only saturating tyres know what is left to hold the speed: tyre='magic_formula' with dynamics='dynamic'",
            lambda s: s.model.saturates,
        ),
    )

    def _settle(self) -> None:
        if isinstance(self.speed, FileSpeed) and self.speed.maximum is None:
            largest = max(float(speeds.max()) for _, speeds in road_set(self.road, self.speed))
            object.__setattr__(self, "speed", FileSpeed(largest))
        choose("dynamics", self.dynamics, ("dynamic", "kinematic"))
        choose("tyre", self.tyre, TYRES)
        if self.model.transfers_load and isinstance(self.speed, LimitedSpeed):
            object.__setattr__(self, "speed", replace(self.speed, friction_ellipse=True))
        super()._settle()
        if self.max_steering_angle is None:
            sharpest = max(road.peak_curvature for road, _ in road_set(self.road, self.speed))
            object.__setattr__(self, "max_steering_angle", steering_range(self.vehicle.wheelbase, sharpest))

    def _lap(self) -> float:
        """One pass at the slowest profile; on a closed road a car outside its lane's centre needs longer."""
        slowed = math.sqrt(self._factor)
        return max(
            (_OUTSIDE if road.closed else 1.0) * lap_time(road, speeds) / slowed
            for road, speeds in road_set(self.road, self.speed)
        )

    def _check(self) -> None:
        if not isinstance(self.cornering_drag, bool):
            raise ValueError(f"cornering_drag={shown(self.cornering_drag)} is not allowed: it must be True or False")
        require("friction", self.friction, "", at_least=1e-3, at_most=2.0)
        require("preview", self.preview, "samples", at_least=0, at_most=1000, whole=True)
        require("preview_interval", self.preview_interval, "s", at_least=1e-4, at_most=60.0)
        super()._check()

    @property
    def model(self) -> models.CarModel:
        """The vehicle model."""
        model = _MODELS[self.dynamics, self.tyre]
        return _HELD.get(model, model) if self.cornering_drag else model

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        preview = {at.PREVIEW: self.preview, at.PREVIEW_TIME: self.preview_interval}
        return {**super().numbers(), **numbers_of(self.vehicle), **preview}

    @property
    def _friction(self) -> float:
        return self.friction

    def _slowest(self) -> float:
        """Lowest speed of the profile on any of the roads, where it is slowed down the most, m/s."""
        if self.model.pace == HELD:
            return 0.0
        slowest = min(float(speeds.min()) for _, speeds in road_set(self.road, self.speed))
        return slowest * math.sqrt(self._factor)

    @property
    def _factor(self) -> float:
        """By how much the square of the profile's speed is lowered at the most."""
        factor = self.randomisation.speed[0] ** 2
        if self.model.saturates and self.speed.lateral_limit > 0.0:
            grip = FRICTION_SHARE * GRAVITY * self.friction * self.randomisation.friction[0] * self._least_share
            factor = min(factor, grip / self.speed.lateral_limit)
        return factor

    def _channels(self) -> list[Channel]:
        seen = Measured()
        channels = [
            Channel("lateral_error", "m", -20.0, 20.0, "centre of gravity left of the lane's centre", at.LATERAL, seen),
            Channel(
                "heading_error", "rad", -math.pi, math.pi, "heading minus the road's, left positive", at.HEADING, seen
            ),
            Channel("yaw_rate", "rad/s", -4.0, 4.0, "left positive", at.YAW_RATE, seen),
            Channel("speed", "m/s", 0.0, 100.0, "present speed", at.SPEED, seen),
            *steering_channels(),
        ]
        for k in range(self.preview):
            ahead = f"{k * self.preview_interval:g} s ahead" if k else "at the car"
            channels.append(self._curvature(f"curvature_preview_{k}", f"of the road {ahead}, left positive"))
        if self.observation == "full":
            channels += [
                Channel("sideslip", "rad", -math.pi, math.pi, "course minus heading", at.SIDESLIP),
                self._curvature("curvature", "of the road at the car, left positive", at.CURVATURE_HERE),
                Channel(
                    "lateral_acceleration",
                    "m/s²",
                    -50.0,
                    50.0,
                    "of the centre of gravity, left positive",
                    at.ACCELERATION,
                ),
            ]
        return channels


@dataclass(frozen=True)
class RoadWorksScenario(LaneKeepScenario):
    """`lanekeep/RoadWorks-v0`: lane keeping in a narrow lane whose centre shifts sideways, at 80 km/h.

    The car departs when its body touches the lane's edge, so what is left is (lane_width - car width) / 2.
    """

    road: RoadSpec = field(default_factory=RoadWorksRoads)
    speed: SpeedSpec = field(default_factory=lambda: LimitedSpeed(maximum=80.0 / 3.6))
    start_lateral_error: float = 0.15
    start_course_error: float = math.radians(1.0)
    lane_width: float = 2.75
    reference_lateral_error: float = 0.15

    def _check(self) -> None:
        require("lane_width", self.lane_width, "m (the car's width)", above=self.vehicle.width)
        super()._check()

    @property
    def departure_limit(self) -> float:
        """Lateral error at which the body touches the lane's edge, m."""
        return (self.lane_width - self.vehicle.width) / 2
