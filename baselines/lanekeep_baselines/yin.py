"""Yin 2010: gain-scheduled LQR for cars at 68 to 180 km/h, alone, with two disturbance observers, with feedforward.

The edge between the project's signs and Yin's is here, in `_YinPolicy`: Yin's errors are path minus vehicle and his
steering angle is the steering wheel's (see `yin_design`), the channels are vehicle minus path and road wheel.

All of them know the scenario's nominal car only, whatever friction or mass the road has in store.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats, LaneScenario, SteeringPolicy, TyreScenario
from lanekeep_baselines.table import Table, weighted_sum
from lanekeep_baselines.yin_design import (
    SCHEDULE,
    STEERING_RATIO,
    YinModel,
    control_gains,
    printed_weights,
    redesigned_weights,
    without_delay,
)
from lanekeep_baselines.yin_observer import Observer
from lanekeep_env.physics.parameters import VehicleParameters


class _YinPolicy(SteeringPolicy):
    """The design model, the scheduled gains k_c and the change of signs and units."""

    reads: ClassVar[tuple[str, ...]] = ("lateral_error", "heading_error", "yaw_rate", "speed", "steering_angle")
    packages = ("control", "scipy")

    def __init__(self, scenario: TyreScenario) -> None:
        super().__init__(scenario)
        self._model = YinModel.of(self.car(scenario.vehicle), STEERING_RATIO, slip=scenario.dynamics != "kinematic")
        self._gains = Table(SCHEDULE, np.stack([control_gains(self._model, speed) for speed in SCHEDULE]))

    @staticmethod
    def car(vehicle: VehicleParameters) -> VehicleParameters:
        """Return the car of the design; the published designs know no delay."""
        return vehicle

    @staticmethod
    def states(at: Mapping[str, Floats]) -> Floats:
        """Return the measured (delta_L, r, theta_d, y_d) in Yin's signs and units, (n, 4)."""
        wheel = STEERING_RATIO * at["steering_angle"]
        return np.stack([wheel, at["yaw_rate"], -at["heading_error"], -at["lateral_error"]], axis=1)

    def feedback(self, speed: Floats, states: Floats) -> Floats:
        """Return -k_c(v) x as steering wheel, rad, (n,)."""
        return -weighted_sum(self._gains(speed), states)


class YinLqr(_YinPolicy):
    """`yin-lqr`: state feedback u = -k_c(v) (delta_L, r, theta_d, y_d).

    Exact on straights only: in a curve yaw rate and steering are fed back without their curve values, so that it runs
    wide (steady 0.80 m on the reduced plant at 25 m/s and a radius of 333 m).
    """

    name = "yin-lqr"

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        return self.feedback(at["speed"], self.states(at)) / STEERING_RATIO, None


class _YinObserverPolicy(_YinPolicy):
    """State feedback minus the steering that the observer believes the curve to ask for."""

    reads = (*_YinPolicy.reads, "steering_command")
    memory = Observer.memory
    feeds_back_estimates: ClassVar[bool]

    @staticmethod
    def weights(speed: float) -> tuple[Floats, Floats]:
        """Return Q_o and R_o for a design speed in m/s."""
        raise NotImplementedError

    def __init__(self, scenario: TyreScenario) -> None:
        super().__init__(scenario)
        self._observer = Observer(self._model, self.weights, scenario.control_step)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        states = self.states(at)
        applied = STEERING_RATIO * at["steering_command"]
        memory = self._observer.update(memory, fresh, at["speed"], states[:, 0], applied, states[:, 1:])
        fed_back = memory[:, :4] if self.feeds_back_estimates else states
        return (self.feedback(at["speed"], fed_back) - memory[:, 4]) / STEERING_RATIO, memory


class YinLqrObserverPrinted(_YinObserverPolicy):
    """`yin-lqr-observer-printed`: the published observer; measured states fed back, minus the estimated delta_s.

    Halves the error of `yin-lqr` in a constant curve (0.41 m) and hardly helps in changing ones: its slowest pole is
    -0.36 1/s at 25 m/s, and the yaw rate that it trusts contains v kappa, which its model lacks.
    """

    name = "yin-lqr-observer-printed"
    feeds_back_estimates = False

    @staticmethod
    def weights(speed: float) -> tuple[Floats, Floats]:
        return printed_weights(speed)


class YinLqrObserver(_YinObserverPolicy):
    """`yin-lqr-observer`: the redesign; estimated states fed back, yaw rate distrusted, delta_s fast.

    The estimates see a curve as a steering offset, so that what is fed back has no curve values left in it. It pays
    with noise: with 5 mrad/s, 3 mrad and 3 cm (standard deviations) in yaw rate, heading and lateral error, Yin's
    steering wheel moves at 1.5 rad/s RMS at 19 m/s and 50 ms, against 0.43 rad/s with `yin-lqr`.

    Its model has no sideslip: on the van, whose tyres are soft for its mass, it is unstable from 30 m/s on (25 m/s with
    50 ms of steering delay), and weights between these and the printed ones do not mend it. `lqg`, which has sideslip
    in its model, is stable there.
    """

    name = "yin-lqr-observer"
    feeds_back_estimates = True

    @staticmethod
    def car(vehicle: VehicleParameters) -> VehicleParameters:
        return without_delay(vehicle)

    @staticmethod
    def weights(speed: float) -> tuple[Floats, Floats]:
        return redesigned_weights(speed)


class YinLqrFeedforward(_YinPolicy):
    """`yin-lqr-feedforward`: the LQR about the steady curve of the full car, an extension of the publication.

    For the measured curvature kappa, the car with sideslip drives a constant curve exactly with yaw rate v kappa,
    heading error minus sideslip and a known steering angle. Feeding back the differences to these leaves no steady
    error. With a preview that reaches far enough, the steering is asked for early by what it loses on the way:
    lag and delay of the actuator and half a control step; with preview=1 it comes late by that much.
    """

    name = "yin-lqr-feedforward"
    reads = (*_YinPolicy.reads, "curvature_preview_0")
    uses = ("curvature_preview_*",)

    def __init__(self, scenario: LaneScenario) -> None:
        super().__init__(scenario)
        self._sideslip, self._steering = self._model.steady_curve()
        samples = sum(channel.startswith("curvature_preview_") for channel in self._order)
        actuator = scenario.vehicle.steering
        ahead = (actuator.lag + actuator.delay + scenario.control_step / 2) / scenario.preview_interval
        first = min(int(ahead), samples - 1)
        second = min(first + 1, samples - 1)
        self._early = f"curvature_preview_{first}", f"curvature_preview_{second}", ahead - first

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        speed, curvature = at["speed"], at["curvature_preview_0"]
        first, second, part = self._early
        early = at[first] + part * (at[second] - at[first])
        square = speed * speed
        steering = self._steering[0] + self._steering[1] * square
        sideslip = (self._sideslip[0] + self._sideslip[1] * square) * curvature
        # Lateral error stays zero while the course follows the road: heading error -sideslip, Yin's theta_d +sideslip.
        wanted = np.stack([steering * curvature, speed * curvature, sideslip, np.zeros_like(speed)], axis=1)
        wheel = steering * early + self.feedback(speed, self.states(at) - wanted)
        return wheel / STEERING_RATIO, None
