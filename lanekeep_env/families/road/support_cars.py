"""The arrays behind an environment with a driver: those on roads, and the driver's numbers."""

from __future__ import annotations

from lanekeep_env import layout as at
from lanekeep_env.families.road.cars import RoadCars
from lanekeep_env.families.road.support import WITH_DRIVER


class SupportCars(RoadCars):
    """n cars on roads, each with a driver."""

    family = WITH_DRIVER
    asked_rows = (at.DRIVER, at.SERVO)

    def _bind(self) -> None:
        super()._bind()
        self.equipment = *self.equipment, self.scenario.driver_numbers()
