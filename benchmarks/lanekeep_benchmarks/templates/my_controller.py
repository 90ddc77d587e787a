"""`my-controller`: feedback of lateral and heading error, and the steering angle that the curve itself asks for.

Compare it:  lanekeep bench --policies stanley,my_controller.py:MyController --episodes 16
Look at it:  lanekeep play lanekeep/LaneKeep-v0 --policy my_controller.py:MyController
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines import SteeringPolicy

Floats = NDArray[np.float64]


class MyController(SteeringPolicy):
    """Two gains, and what the nominal car needs in a steady curve."""

    name = "my-controller"
    reads = (
        "lateral_error",
        "heading_error",
        "speed",
    )  # channels that it cannot do without; lanekeep envs lists all of them
    uses = ("curvature_preview_0",)  # channels that it reads where they are there: with preview=1 or more
    memory = 0  # numbers that it remembers from one step to the next

    def __init__(self, scenario: Any) -> None:
        super().__init__(scenario)
        car = scenario.vehicle  # the nominal one; the car that is driven may differ
        self._wheelbase = car.wheelbase
        front = car.cg_to_rear_axle / car.front_cornering_stiffness
        rear = car.cg_to_front_axle / car.rear_cornering_stiffness
        self._understeer = car.mass * (front - rear) / car.wheelbase  # rad s²/m

    def command(self, at: Mapping[str, Floats], memory: Floats, fresh: Any) -> tuple[Floats, Floats | None]:
        """Return the road-wheel angle, rad, + left, and the next memory; every array has one row for each car."""
        curve = at.get("curvature_preview_0", np.zeros_like(at["lateral_error"]))
        steady = (self._wheelbase + self._understeer * at["speed"] ** 2) * curve
        return steady - 0.05 * at["lateral_error"] - 0.6 * at["heading_error"], None
