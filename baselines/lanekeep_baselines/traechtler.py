"""The PD controller of a camera-guided van, on the distance of the road's edge that the camera sees.

Source: Trächtler, Lohmann, Struck, "Regelung der Querbewegung eines kamerageführten Straßenfahrzeugs", 1992, section 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats, Scenario, SteeringPolicy
from lanekeep_baselines.traechtler_model import CameraModel
from lanekeep_env.scenario import Camera

#: Time constant of the D part's filter, s; far below that of the closed loop, (l + f)/v.
FILTER = 0.1


class CameraScenario(Scenario, Protocol):
    """What a camera-guided controller may know besides; `lanekeep_env.CameraLaneScenario` is one."""

    @property
    def camera(self) -> Camera: ...
    @property
    def set_distance(self) -> float: ...


class TraechtlerPd(SteeringPolicy):
    """`traechtler-pd`: delta = -K2 e - K3 e' on the deviation e of the look-ahead point.

    K2 = 2 l/(l + f)², K3 = T K2 (the source: "very small", tuned while driving; this one cancels the actuator's lag and
    makes the damping 1/sqrt(2) at every speed). Where the scenario has set points, e counts from them. The look-ahead
    point is not kept at its distance in curves: the rear wheel is, and the curve is not cut. The D part passes a filter
    of 0.1 s, which starts anew when the edge comes back into sight. While it is out of sight the last distance counts.
    """

    name = "traechtler-pd"
    reads: ClassVar[tuple[str, ...]] = ("edge_distance", "edge_valid", "speed")
    uses: ClassVar[tuple[str, ...]] = ("set_distance",)
    memory = 2  # filtered deviation, whether the edge was in sight
    #: Share of K2 and K3 that is left out at `full_speed` and above, in proportion to the speed below.
    lowering: ClassVar[float] = 0.0
    full_speed: ClassVar[float] = 6.0
    #: K3 over T K2.
    derivative: ClassVar[float] = 1.0

    def __init__(self, scenario: CameraScenario) -> None:
        super().__init__(scenario)
        self._model = CameraModel(scenario.vehicle.wheelbase, scenario.camera.look_ahead, scenario.vehicle.steering.lag)
        self._set_distance = scenario.set_distance
        self._side = -1.0 if scenario.camera.edge == "left" else 1.0
        self._limit = scenario.max_steering_angle
        self._step = scenario.control_step
        self._follow = 1.0 - float(np.exp(-scenario.control_step / FILTER))
        # By which the filter's lag is divided for the rate: FILTER in the limit, and exact on a steady rate.
        self._smoothing = scenario.control_step / self._follow

    def feedback(self, deviation: Floats, rate: Floats, v: Floats) -> Floats:
        """Return the road-wheel angle asked for, rad, for e (m), e' (m/s) and the speed (m/s)."""
        share = 1.0 - self.lowering * np.minimum(v / self.full_speed, 1.0)
        derivative = self.derivative * self._model.derivative_gain
        return -share * (self._model.proportional_gain * deviation + derivative * rate)

    def wanted(self, at: Mapping[str, Floats]) -> Floats | float:
        """Return the distance from the edge that is to be kept, m."""
        return at.get("set_distance", self._set_distance)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        deviation = self._side * (at["edge_distance"] - self.wanted(at))
        valid = at["edge_valid"] > 0.5
        anew = fresh | (valid & (memory[:, 1] < 0.5))
        filtered = np.where(anew, deviation, memory[:, 0])
        rate = (deviation - filtered) / self._smoothing
        filtered = filtered + self._follow * (deviation - filtered)
        return self.feedback(deviation, rate, at["speed"]), np.stack([filtered, valid], axis=1)


class TraechtlerPdLowered(TraechtlerPd):
    """`traechtler-pd-lowered`: the gains fall by up to 20 % towards 6 m/s, the source's option for calmer steering.

    It calms the steering and does not raise the damping; the price is a rear offset in curves of
    (l + f)²/2 (1/k - 1) kappa for a share k of K2.
    """

    name = "traechtler-pd-lowered"
    lowering = 0.2


class TraechtlerP(TraechtlerPd):
    """`traechtler-p`: the same with K3 = 0, whose damping falls from 0.71 at 1 m/s to 0.54 at 6 m/s.

    The source leaves K3 open. It is a policy and no option of `traechtler-pd`, as -lowered is, so that the benchmark
    names and compares it; options (`lanekeep_baselines.make`) switch off what is not the source's.
    """

    name = "traechtler-p"
    memory = 0
    derivative = 0.0

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        deviation = self._side * (at["edge_distance"] - self.wanted(at))
        return self.feedback(deviation, np.zeros_like(deviation), at["speed"]), None
