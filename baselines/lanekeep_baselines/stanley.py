"""Stanley, the front-axle controller of the DARPA Grand Challenge car.

Sources: Thrun et al., "Stanley: The robot that won the DARPA Grand Challenge", J. Field Robotics 23(9), 2006 (the law
and its convergence); Hoffmann, Tomlin, Montemerlo, Thrun, "Autonomous automobile trajectory tracking for off-road
driving", ACC 2007 (softening, yaw damping, steady slip). Both count angles to the path minus ours: signs turn here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats, SteeringPolicy, TyreScenario, turned_on_the_way
from lanekeep_baselines.tunable import Tunable


class Stanley(SteeringPolicy):
    """`stanley`: the front wheels point along the path, and towards it by atan(gain d_f / (softening + v)).

    delta = -theta_f - atan(k d_f / (k_soft + v)) + psi_ss - k_d (r - v kappa), road wheel, rad, with d_f and theta_f
    the errors of the front axle against the path beside it. On a car without slip and with k_soft = 0 the error follows
    d_f' = -k d_f / sqrt(1 + (k d_f / v)²), v the front wheels' speed, exactly and from any start.

    With `curvature_preview_0` the path is the circle of that curvature kappa; psi_ss, the front slip of a steady curve,
    and the yaw rate v kappa then leave no steady error. Without previews kappa counts as 0, and the car runs wide.
    Below walking pace the command follows the way driven (`turned_on_the_way`).
    Scenarios without slip have neither psi_ss nor yaw damping (sampled, it would be unstable where nothing slips).
    """

    name = "stanley"
    reads = ("lateral_error", "heading_error", "yaw_rate", "speed", "steering_command")
    uses = ("curvature_preview_0",)
    memory = 1  # the last command, rad
    #: k, 1/s: small errors decay with exp(-k t).
    gain: ClassVar[float] = 2.0
    #: k_soft, m/s: bounds the gain on the error at standstill.
    softening: ClassVar[float] = 1.0
    #: k_d, rad of road wheel per rad/s, 0 for none; keeps the yaw mode damped above 20 m/s (Yin's car at 50 m/s: 0.17
    #: with it, 0.05 without).
    yaw_damping: ClassVar[float] = 0.1
    tunable = (
        Tunable("gain", 0.2, 20.0),
        Tunable("softening", 0.1, 10.0),
        Tunable("yaw_damping", 0.0, 0.5, log=False),
    )

    def __init__(self, scenario: TyreScenario) -> None:
        super().__init__(scenario)
        car = scenario.vehicle
        slips = scenario.dynamics != "kinematic"
        self._step = scenario.control_step
        self._to_front = car.cg_to_front_axle
        self._damping = self.yaw_damping if slips else 0.0
        # Front axle mass over stiffness: slip per lateral acceleration, rad s²/m.
        front_mass = car.mass * car.cg_to_rear_axle / car.wheelbase
        self._slip = front_mass / car.front_cornering_stiffness if slips else 0.0

    def front_axle(self, lateral: Floats, heading: Floats, curvature: Floats) -> tuple[Floats, Floats]:
        """Return lateral and heading error of the front axle against a circle of ``curvature``, m and rad, (n,)."""
        x = self._to_front * np.cos(heading)
        y = lateral + self._to_front * np.sin(heading)
        ahead, aside = curvature * x, 1.0 - curvature * y
        # (1 - distance from the centre times kappa) / kappa, in a form that is good for kappa = 0.
        lateral = (2.0 * y - curvature * (x * x + y * y)) / (1.0 + np.sqrt(ahead * ahead + aside * aside))
        return lateral, heading - np.arctan2(ahead, aside)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        before = np.where(fresh, at["steering_command"], memory[:, 0])
        steer = turned_on_the_way(self.wanted(at), before, at["speed"], self._step)
        return steer, steer[:, None]

    def wanted(self, at: Mapping[str, Floats]) -> Floats:
        """Return the road-wheel angle of the law, rad, (n,)."""
        speed = at["speed"]
        curvature = at.get("curvature_preview_0", np.zeros_like(speed))
        lateral, heading = self.front_axle(at["lateral_error"], at["heading_error"], curvature)
        turning = speed * curvature
        # At standstill and without softening the gain is unbounded: the angle is then at its limit, not NaN.
        pull = np.arctan2(self.gain * lateral, self.softening + speed)
        damping = self._damping * (at["yaw_rate"] - turning)
        return self._slip * speed * turning - heading - pull - damping
