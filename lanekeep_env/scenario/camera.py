"""Guidance by camera: scenarios of a van that sees the road's edge ahead of it, at walking to town speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, from_mapping, plain_numbers, require, shown
from lanekeep_env.physics import models
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.roads import RoadSpec, SetSpeeds, TurnOffRoads, YardRoads, set_speeds_from
from lanekeep_env.scenario.base import Channel, Measured, steering_channels
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.guidance import PlanErrors, SetPoints, guidance_numbers, plan_errors_from, set_points_from
from lanekeep_env.scenario.road import RoadScenario
from lanekeep_env.sensing.faults import CAMERA_SENSOR_SETS, SensorSets


@dataclass(frozen=True)
class Camera:
    """A camera fixed to the body that measures how far the road's edge is from the body's axis.

    Attributes:
        look_ahead: distance of the measured point ahead of the front axle, m.
        edge: "right" or "left".
        field_of_view: horizontal angle, rad; the camera sits on the axis above the front axle.
    """

    look_ahead: float = 3.5
    edge: str = "right"
    field_of_view: float = math.radians(110.0)

    def __post_init__(self) -> None:
        require("camera.look_ahead", self.look_ahead, "m", above=0.0, at_most=100.0)
        choose("camera.edge", self.edge, ("right", "left"))
        require("camera.field_of_view", self.field_of_view, "rad", above=0.0, at_most=math.radians(170.0))
        plain_numbers(self)

    @property
    def widest(self) -> float:
        """Largest distance of the edge, either side, that is inside the field of view, m."""
        return self.look_ahead * math.tan(self.field_of_view / 2)


def camera_from(value: Mapping[str, Any] | Camera) -> Camera:
    """Read a camera: a record or a mapping of its fields; ValueError names what is wrong."""
    if isinstance(value, Camera):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f"camera={shown(value)} must be a mapping of Camera's fields, e.g. {{'look_ahead': 3.5}}")
    return from_mapping(Camera, value, "camera")


@dataclass(frozen=True)
class CameraLaneScenario(RoadScenario):
    """Everything that defines `lanekeep/CameraLane-v0`; every field is a keyword of ``gym.make``.

    The fields of `RoadScenario` and these:

    Attributes:
        speed: of the front wheels: m/s, or a mapping of `SetSpeeds` (by default a new set speed between 0 and 6 m/s
            every 8 s, one in ten of them a stop).
        camera: a mapping of `Camera`.
        plan: number of samples of the planned curvature in the observation, the first one at the rear axle.
        plan_spacing: distance between them, m.
        plan_errors: a mapping of `PlanErrors`: how much later (``offset``, m), with how much larger radii and angles
            (``radius``, ``angle``, shares: 0.1 is a tenth) the plan has bends, and how late (``recognised``, m).
        set_points: distance that the edge is to be kept at: None for half the lane's width, a number (m), or a mapping
            of `SetPoints` that change in time. The channel set_distance then tells it, and the running cost counts
            from it; lateral_error stays that of the lane's centre.

    Errors are the rear axle's. The road's edges are half of ``lane_width`` from its centre line, so that is
    the distance which the camera shows on a straight.
    """

    vehicle: VehicleParameters = VEHICLES["van"]
    road: RoadSpec = field(default_factory=YardRoads)
    speed: SetSpeeds = field(default_factory=SetSpeeds)
    max_steering_angle: float = 0.6
    max_steering_rate: float = math.radians(20.0)
    start_lateral_error: float = 0.3
    start_course_error: float = math.radians(3.0)
    lane_width: float = 3.0
    reference_lateral_error: float = 0.4
    reference_steering_rate: float = 0.2
    control_step: float = 0.04
    episode_steps: int = 1000
    camera: Camera = field(default_factory=Camera)
    plan: int = 20
    plan_spacing: float = 0.5
    plan_errors: PlanErrors = field(default_factory=PlanErrors)
    set_points: SetPoints | None = None

    _sensor_sets: ClassVar[SensorSets] = CAMERA_SENSOR_SETS
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **RoadScenario._readers,
        "speed": set_speeds_from,
        "camera": camera_from,
        "plan_errors": plan_errors_from,
        "set_points": set_points_from,
    }
    _needs: ClassVar[tuple[Need, ...]] = (
        *RoadScenario._needs,
        Need(
            "plan_spacing",
            "distance between planned samples",
            "it takes two samples, plan >= 2, the first one is at the rear axle",
            lambda s: s.plan >= 2,
        ),
        Need("plan_errors", "errors of the plan", "plan=0 is no plan", lambda s: s.plan >= 1),
    )
    preview_channel: ClassVar[str] = "planned_curvature_0"
    view: ClassVar[float] = 40.0

    def _check(self) -> None:
        require("plan", self.plan, "samples", at_least=0, at_most=1000, whole=True)
        require("plan_spacing", self.plan_spacing, "m", at_least=1e-3, at_most=1e3)
        super()._check()
        if self.set_points is not None:
            require("set_points.maximum", self.set_points.maximum, "m (the lane's width)", at_most=self.lane_width)
            hold = self.set_points.hold
            if hold is not None and abs(hold / self.control_step - round(hold / self.control_step)) > 1e-6:
                raise ValueError(
                    f"set_points.hold={hold!r} is not allowed: it must be a multiple of the control step, "
                    f"{self.control_step} s"
                )

    @property
    def model(self) -> models.CarModel:
        """The vehicle model."""
        return models.FRONT_DRIVEN

    @property
    def axles(self) -> tuple[float, float]:
        """The reference point is the rear axle."""
        return self.vehicle.wheelbase, 0.0

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        return {**super().numbers(), at.PREVIEW: self.plan, at.PREVIEW_DISTANCE: self.plan_spacing}

    @property
    def set_distance(self) -> float:
        """Distance of the edge from the road's centre line, m: what the camera shows on a straight."""
        return self.lane_width / 2

    @property
    def told_more(self) -> bool:
        """Whether set points or errors of the plan take a kernel of their own."""
        return self.set_points is not None or not self.plan_errors.none

    def guidance_numbers(self) -> np.ndarray:
        """Numbers of set points and errors, (12,)."""
        points = self.set_points or SetPoints(self.set_distance, self.set_distance, None)
        return guidance_numbers(self.plan_errors, points, self.camera.edge == "right", self.control_step)

    @property
    def reach(self) -> float:
        """Distance of the camera's look-ahead point from the rear axle, l + f, m."""
        return self.vehicle.wheelbase + self.camera.look_ahead

    def _channels(self) -> list[Channel]:
        side, ahead = self.camera.edge, f"{self.camera.look_ahead:g} m ahead of the front axle"
        camera = Measured(valid="edge_valid", missing=self.set_distance)
        shown = f"of the body's axis {ahead} from the {side} edge; held if lost"
        channels = [
            Channel("edge_distance", "m", -20.0, 20.0, shown, at.EDGE, camera),
            Channel("edge_valid", "", 0.0, 1.0, "1 where the camera's last picture showed the edge, else 0"),
            Channel("speed", "m/s", 0.0, 100.0, "of the front wheels", at.SPEED, Measured()),
            *steering_channels(),
        ]
        if self.set_points is not None:
            channels.append(Channel("set_distance", "m", 0.0, 100.0, "that the edge is to be kept at", at.SET_POINT))
        for k in range(self.plan):
            where = f"{k * self.plan_spacing:g} m ahead of the rear axle" if k else "at the rear axle"
            channels.append(self._curvature(f"planned_curvature_{k}", f"of the road {where}, left positive"))
        if self.observation == "full":
            channels += [
                Channel("lateral_error", "m", -20.0, 20.0, "rear axle left of the lane's centre", at.LATERAL),
                Channel(
                    "heading_error", "rad", -math.pi, math.pi, "heading minus the road's, left positive", at.HEADING
                ),
                Channel("motor_angle", "rad", -1.6, 1.6, "of the steering motor, in terms of the road wheel", at.MOTOR),
            ]
        return channels


@dataclass(frozen=True)
class TurnOffScenario(CameraLaneScenario):
    """`lanekeep/TurnOff-v0`: a left curve, a straight, and a turn off the road without a visible edge."""

    road: RoadSpec = field(default_factory=TurnOffRoads)
    speed: SetSpeeds = field(
        default_factory=lambda: SetSpeeds(minimum=2.0, hold=None, standstill=0.0, lateral_acceleration=None)
    )
    start_lateral_error: float = 0.1
    start_course_error: float = math.radians(1.0)
    episode_steps: int = 1500
