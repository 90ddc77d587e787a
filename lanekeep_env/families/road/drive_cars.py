"""The arrays behind an environment with a powertrain: those on roads, engine and traffic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.families.road.cars import RoadCars
from lanekeep_env.families.road.drive_kernel import DRIVING
from lanekeep_env.rendering.road_picture import Pose
from lanekeep_env.tasks.termination import Termination

#: What pictures call them.
_FAILURES: dict[int, str] = {Termination.CONTACT: "met another car", Termination.STOP_PASSED: "passed the stop point"}


class DriveCars(RoadCars):
    """n cars with pedals."""

    family = DRIVING
    axle_rows = (at.FRONT_GRIP, at.REAR_GRIP)

    def _drive(self) -> tuple[np.ndarray | None, ...]:
        s = self.scenario
        return s.powertrain.numbers(s.integration.step).astype(self.dtype), s.traffic.build()

    def pose(self, column: int) -> Pose:
        """Where the car of a column is, and what is ahead of it, for pictures."""
        block, i = divmod(column, self.cars.shape[2])
        car = self.cars[block, :, i]
        gap, stop = float(car[at.LEAD_GAP]), float(car[at.STOP_GAP])
        way = 1.0 if car[at.SPEED_TARGET] >= 0.0 else -1.0
        return replace(
            super().pose(column),
            lead_gap=way * gap if gap < at.FAR else None,
            stop_gap=way * stop if stop < at.FAR else None,
            backwards=way < 0.0,
            failure=_FAILURES.get(int(car[at.FAILED])),
        )
