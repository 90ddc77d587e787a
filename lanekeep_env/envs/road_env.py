"""The family on roads."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.engine.reset_options import ROAD_STARTS
from lanekeep_env.envs.info import Rows
from lanekeep_env.envs.single import SingleEnv
from lanekeep_env.envs.skin import Skin
from lanekeep_env.roads import Road
from lanekeep_env.scenario import RoadScenario


class OnRoads(Skin):
    """What environments on roads share, single or vector."""

    scenario_class: type[RoadScenario]
    starts = ROAD_STARTS

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        from lanekeep_env.families.road.cars import RoadCars

        return RoadCars(*arguments)

    @staticmethod
    def make_picture(scenario: Any) -> Any:
        """Return what draws a car of the scenario."""
        from lanekeep_env.rendering.road_picture import RoadPicture

        return RoadPicture(scenario)

    def road_set(self) -> tuple[tuple[Road, np.ndarray], ...]:
        """The roads an episode is drawn from, each with its node speeds in m/s."""
        roads: tuple[tuple[Road, np.ndarray], ...] = self._core.road_set()
        return roads


class RoadEnv(OnRoads, SingleEnv):
    """One car on a road; subclasses name the task's scenario, and are its page of documentation."""


class WithDriver(OnRoads):
    """What environments with a driver at the wheel share, single or vector."""

    further: ClassVar[Rows] = (
        ("interventions", at.O_INTERVENTIONS),
        ("authority", at.O_AUTHORITY),
        ("assistance", at.O_ASSISTANCE),
        ("handover_jump", at.O_HANDOVER),
    )

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        from lanekeep_env.families.road.support_cars import SupportCars

        return SupportCars(*arguments)


class DriverEnv(WithDriver, SingleEnv):
    """One car with a driver; subclasses name the task's scenario, and are its page of documentation."""


class Guided(OnRoads):
    """What camera-guided environments share, single or vector."""

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        if not arguments[0].told_more:
            return OnRoads.make_cars(*arguments)
        from lanekeep_env.families.road.guided_cars import GuidedCars

        return GuidedCars(*arguments)


class GuidedEnv(Guided, SingleEnv):
    """One camera-guided car; subclasses name the task's scenario, and are its page of documentation."""


class Driving(OnRoads):
    """What environments with a powertrain share."""

    further: ClassVar[Rows] = (
        ("gap", at.O_GAP),
        ("time_to_collision", at.O_TIME_TO_COLLISION),
        ("stop_error", at.O_STOP_ERROR),
        ("speed_error", at.O_SPEED_ERROR),
        ("jerk", at.O_JERK),
        ("contact", at.O_CONTACT),
        ("avoidable_contact", at.O_AVOIDABLE_CONTACT),
        ("overrun", at.O_OVERRUN),
        ("avoidable_overrun", at.O_AVOIDABLE_OVERRUN),
    )

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        from lanekeep_env.families.road.drive_cars import DriveCars

        return DriveCars(*arguments)


class AmongTraffic(Driving):
    """What environments among other cars share."""

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        from lanekeep_env.families.road.traffic_cars import TrafficCars

        return TrafficCars(*arguments)


class PoweredEnv(Driving, SingleEnv):
    """One car with pedals; subclasses name the task's scenario, and are its page of documentation."""
