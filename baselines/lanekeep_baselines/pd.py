"""The plain reference: proportional feedback of lateral and heading error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats, SteeringPolicy
from lanekeep_baselines.tunable import Tunable


class ProportionalDerivative(SteeringPolicy):
    """`pd`: PD control of the lateral error; the heading error, its rate over the speed, is the D part.

    delta = -lateral_gain * lateral_error - heading_gain * heading_error, road wheel, rad. Two constants for every car
    and every speed, no model, no memory.
    """

    name = "pd"
    reads = ("lateral_error", "heading_error")
    #: rad of road wheel per m, and per rad.
    lateral_gain: ClassVar[float] = 0.03
    heading_gain: ClassVar[float] = 0.6
    tunable = (Tunable("lateral_gain", 0.003, 0.3), Tunable("heading_gain", 0.06, 6.0))

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        return -self.lateral_gain * at["lateral_error"] - self.heading_gain * at["heading_error"], None
