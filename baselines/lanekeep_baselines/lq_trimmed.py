"""`lq-preview-trimmed`: `lq-preview-offset-free` that also finds out what the road wheel has more than it is told.

Slip offsets stand for all that pushes a car sideways, and not for a steering that turns the wheels elsewhere than it
is told: that error is measured, and nothing estimates it there. Here it is the difference of the measured angle and of
the nominal actuator's, through a first-order filter, and taken off the command. With the nominal actuator the
difference knows nothing of the command, so that no margin is lost.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.lq import CostScenario, LqPreviewOffsetFree
from lanekeep_baselines.policy import Floats

#: Time constant of the filter, s: longer than a bend takes to begin, shorter than a car stays beside its lane's centre.
TRIM_TIME = 3.0


class LqPreviewTrimmed(LqPreviewOffsetFree):
    """`lq-preview-trimmed`: memory is that of `lq-preview-offset-free`, the nominal wheel's angle and the offset."""

    name = "lq-preview-trimmed"

    def __init__(self, scenario: CostScenario) -> None:
        super().__init__(scenario)
        steering, step = scenario.vehicle.steering, scenario.control_step
        late = steering.lag + steering.delay
        self._follows = 1.0 - math.exp(-step / late) if late > 0.0 else 1.0
        self._learns = 1.0 - math.exp(-step / TRIM_TIME)
        self.memory += 2

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        applied, measured = at["steering_command"], at["steering_angle"]
        wheel, offset = applied, measured - applied  # an episode begins in steady driving
        if fresh is not True:
            before, known = memory[:, -2], memory[:, -1]
            followed = before + self._follows * (applied - before)
            found = known + self._learns * (measured - followed - known)
            started = np.asarray(fresh)
            wheel, offset = np.where(started, wheel, followed), np.where(started, offset, found)
        command, kept = super().command({**at, "steering_command": applied + offset}, memory[:, :-2], fresh)
        assert kept is not None
        return command - offset, np.concatenate([kept, wheel[:, None], offset[:, None]], axis=1)
