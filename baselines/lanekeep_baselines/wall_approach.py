"""Along the right wall before parking, so as to start parallel to it and near the row (KnightRiders, outlook 6.2).

The redesigned cascade on the Kalman filter, slowly. Boxes of a row that begins meanwhile are none of the wall: readings
that are not the expected ones correct nothing, the car goes on by odometry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.knightriders import SLOWEST
from lanekeep_baselines.knightriders_park import ParkingDrive
from lanekeep_baselines.policy import DrivingPolicy, Floats
from lanekeep_baselines.wall_cascade import LARGEST_HEADING
from lanekeep_baselines.wall_control import Cascade, Measured
from lanekeep_baselines.wall_design import WallCar
from lanekeep_baselines.wall_estimator import WallFilter, WallNoise
from lanekeep_env.sensing.faults import Sensor


class WallApproach(DrivingPolicy):
    """Comes near the wall on the right and along it; `arrived` tells when. No policy of its own: a part of one."""

    name = "wall-approach"
    reads = ("distance_right", "yaw_rate", "speed", "steering_command")

    #: Distance of the side sensor from the wall, m: 0.4 from a row of cars 0.265 m wide with 0.05 m behind them.
    WANTED, SLOW = 0.7, 0.35
    #: Standard deviation of the heading at the start, rad.
    START: ClassVar[float] = 0.15
    #: What a reading may be off the expected one, m, beside twice its noise.
    SAME: ClassVar[float] = 0.05
    #: It has arrived so near to the wanted distance, m, and the wall's direction, rad, known as well as that, rad.
    NEAR, PARALLEL, SURE = 0.15, float(np.deg2rad(5.0)), float(np.deg2rad(3.0))

    def __init__(self, scenario: ParkingDrive) -> None:
        super().__init__(scenario)
        wheelbase = scenario.vehicle.wheelbase
        self._car = WallCar(wheelbase, 0.5 * wheelbase, scenario.control_step)
        nominal, noise = WallNoise(), dict(scenario.sensors).get("distance_right", Sensor()).noise
        side, (_, _, offset, bias) = max(nominal.side_distance, noise), nominal.start
        self._filter = WallFilter(
            self._car, replace(nominal, side_distance=side, start=(side, self.START, offset, bias))
        )
        self._same = self.SAME + 2.0 * noise
        self._control = Cascade(self._car, scenario.max_steering_angle, LARGEST_HEADING)
        self.memory = self._filter.memory + self._control.memory

    def arrived(self, at: Mapping[str, Floats], memory: Floats) -> NDArray[np.bool_]:
        """Return the rows of a memory (n, memory) that are near the wall, along it, and see it, not a box before it."""
        near = np.abs(memory[:, 0] - self.WANTED) < self.NEAR
        along = (np.abs(memory[:, 1]) < self.PARALLEL) & (memory[:, 9] < self.SURE**2)  # the heading's variance
        return near & along & (np.abs(at["distance_right"] - memory[:, 0]) < self._same)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        speed, right, split = at["speed"], at["distance_right"], self._filter.memory
        expected = memory[:, 0] + speed * self._car.step * np.sin(memory[:, 1])
        same = fresh | (np.abs(right - expected) < self._same)
        known = self._filter.update(
            memory[:, :split], fresh, speed, at["steering_command"], np.where(same, right, 0.0), at["yaw_rate"]
        )
        turned = (at["yaw_rate"] - known[:, 3]) * self._car.step
        measured = Measured(np.maximum(speed, SLOWEST), known[:, 0], known[:, 1], turned)
        wanted = np.full_like(speed, self.WANTED)
        steering, following = self._control.command(measured, wanted, memory[:, split:], fresh)
        commands = np.stack([steering, np.full_like(speed, min(self.SLOW, self._fastest))], axis=1)
        return commands, np.concatenate([known, following], axis=1)
