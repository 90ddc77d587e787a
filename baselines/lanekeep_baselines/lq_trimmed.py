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
from lanekeep_baselines.lq_model import STEER, StepModel
from lanekeep_baselines.policy import Floats

#: Time constant of the filter, s: longer than a bend takes to begin, shorter than a car stays beside its lane's centre.
TRIM_TIME = 3.0


class LqPreviewTrimmed(LqPreviewOffsetFree):
    """`lq-preview-trimmed`; behind the other's memory offset, the nominal wheel's angle and commands on their way."""

    name = "lq-preview-trimmed"

    def __init__(self, scenario: CostScenario) -> None:
        super().__init__(scenario)
        step = scenario.control_step
        model = StepModel.of(scenario.vehicle, 1.0, step, scenario.dynamics != "kinematic")
        # What is left of the wheel's angle after a step, and what the commands make of it, the last one first.
        self._kept, self._gained = model.a[STEER, STEER], model.b[STEER]
        self._learns = 1.0 - math.exp(-step / TRIM_TIME)
        self._others = self.memory
        self.memory += 2 + len(self._gained) - 1

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        applied, measured = at["steering_command"], at["steering_angle"]
        # An episode begins in steady driving.
        offset, wheel, sent = measured - applied, applied, np.stack([applied] * len(self._gained), axis=1)
        if fresh is not True:
            started = np.asarray(fresh)
            known, before = memory[:, self._others], memory[:, self._others + 1]
            commands = np.concatenate([applied[:, None], memory[:, self._others + 2 :]], axis=1)
            followed = self._kept * before
            for gain, one in zip(self._gained, commands.T, strict=True):
                followed = followed + gain * one
            found = known + self._learns * (measured - followed - known)
            offset, wheel = np.where(started, offset, found), np.where(started, wheel, followed)
            sent = np.where(started[..., None], sent, commands)
        asked = {**at, "steering_command": applied + offset}
        command, others = super().command(asked, memory[:, : self._others], fresh)
        assert others is not None
        return command - offset, np.concatenate([others, offset[:, None], wheel[:, None], sent[:, :-1]], axis=1)
