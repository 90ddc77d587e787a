"""Lane keeping support: a driver steers, and an assistant overrides where the car would leave the lane."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, require
from lanekeep_env.roads import LimitedSpeed, RandomRoads, RoadSpec, SpeedSpec
from lanekeep_env.scenario.base import Channel, Measured
from lanekeep_env.scenario.driver import DRIVERS, Driver, driver_from
from lanekeep_env.scenario.effects import Need, never
from lanekeep_env.scenario.lane_keep import LaneKeepScenario


@dataclass(frozen=True)
class LaneSupportScenario(LaneKeepScenario):
    """Everything that defines `lanekeep/LaneSupport-v0`; every field is a keyword of ``gym.make``.

    The fields of `LaneKeepScenario` and these:

    Attributes:
        driver: "attentive", "drowsy" or a mapping of `Driver`, changes to the drowsy one or to its ``base``. What the
            driver asks for is clipped to ``max_steering_angle``, as what the assistant asks for.
        reference_assistance: angle at the road wheel by which the assistant's override costs 1 a second, rad.

    The car departs when its body touches the lane's edge, as in road works.
    """

    road: RoadSpec = field(default_factory=lambda: RandomRoads(peak_curvature=0.004))
    speed: SpeedSpec = field(default_factory=lambda: LimitedSpeed(lateral_acceleration=2.0, maximum=130.0 / 3.6))
    start_lateral_error: float = 0.2
    start_course_error: float = math.radians(0.3)
    lane_width: float = 3.75
    episode_steps: int = 1200
    preview: int = 12
    driver: Driver = DRIVERS["drowsy"]
    reference_assistance: float = 0.02

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {**LaneKeepScenario._readers, "driver": driver_from}
    _needs: ClassVar[tuple[Need, ...]] = (
        Need("reference_lateral_error", "of the running cost", "where in the lane the driver drives is free", never),
        Need("reference_steering_rate", "of the running cost", "the assistant's angle costs, not its rate", never),
        Need("effort", "whose speed costs", "the assistant's angle costs, no speed", never),
        Need(
            "reference_assistance", "of the running cost", "cost_weight=0 takes it away", lambda s: s.cost_weight > 0.0
        ),
        *(
            Need(f"driver.{name}", "of a driver's lapses", "this one never looks away", lambda s: s.driver.lapses)
            for name in ("shortest_lapse", "longest_lapse")
        ),
        Need("driver.wander_time", "of a driver's wandering", "this one does not wander", lambda s: s.driver.wanders),
        *(need for need in LaneKeepScenario._needs if need.field not in ("reference_steering_rate", "effort")),
    )

    def _check(self) -> None:
        require("lane_width", self.lane_width, "m (the car's width)", above=self.vehicle.width)
        require("reference_assistance", self.reference_assistance, "rad", at_least=1e-6, at_most=10.0)
        choose("action", self.action, ("steering_angle",))
        super()._check()

    @property
    def departure_limit(self) -> float:
        """Lateral error at which the body touches the lane's edge, m."""
        return (self.lane_width - self.vehicle.width) / 2

    @property
    def num_actions(self) -> int:
        """The assistant's angle and its authority."""
        return 2

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        return {
            **super().numbers(),
            at.SECOND: (at.AUTHORITY, 0.0, 1.0),
            at.COST_RATE: self.reference_assistance,
        }

    def driver_numbers(self) -> np.ndarray:
        """Numbers of the driver, who knows how the nominal car understeers, (11,)."""
        car, growth = self.vehicle, 0.0
        if self.model.slips:
            front = car.cg_to_rear_axle / car.front_cornering_stiffness
            rear = car.cg_to_front_axle / car.rear_cornering_stiffness
            growth = car.mass / car.wheelbase * (front - rear)
        return self.driver.numbers(self.control_step, (car.wheelbase, growth))

    def _channels(self) -> list[Channel]:
        channels = super()._channels()
        angle = 1.6
        place = next(k for k, channel in enumerate(channels) if channel.name == "steering_command")
        channels[place : place + 1] = [
            Channel("steering_command", "rad", -angle, angle, "of both, which last entered the actuator", at.SERVO),
            Channel("driver_steering", "rad", -angle, angle, "that the driver asks for now", at.DRIVER, Measured()),
            Channel("authority", "", 0.0, 1.0, "of the assistant in the last control step", at.AUTHORITY_BEFORE),
        ]
        return channels
