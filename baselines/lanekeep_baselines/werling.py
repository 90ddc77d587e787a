"""Werling, Gröll, Bretthauer 2008: the lateral control as policies, each loop alone and both.

`werling-lateral` steers the centre of gravity (or, slowly, the rear axle) along a path at any speed forwards,
`werling-reverse` the rear axle in either direction. (`werling-drive`, in `werling_multi`, does all: steering, set
speeds, the car ahead, stop points, with throttle and brake.) The laws and their sources are in `werling_lateral`. The
`-ahead` ones, and `werling-drive`, take the curvature ahead by what the steering actuator lags;
`werling-lateral-predictor`, in `werling_predictor`, takes the state ahead as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.policy import Floats, PreviewScenario, SteeringPolicy
from lanekeep_baselines.werling_lateral import (
    WerlingMeasured,
    WerlingTuning,
    blended_steering,
    curvature_ahead,
    hold_direction,
    kinematic_steering,
)
from lanekeep_baselines.werling_tyres import WerlingCar


class GripScenario(PreviewScenario, Protocol):
    """What the dynamic law may know besides: the road's friction."""

    @property
    def friction(self) -> float: ...


class ReverseScenario(PreviewScenario, Protocol):
    """What the kinematic law alone may know; `lanekeep_env.ReversePathScenario` is one."""

    @property
    def axles(self) -> tuple[float, float]: ...


def _lacking_rear(scenario: ReverseScenario) -> str:
    return "" if scenario.axles[1] == 0.0 else "the errors of the rear axle; the scenario's are not"


class _Ahead(SteeringPolicy):
    """What the lateral policies share: curvature beside the car, and where the steering will have answered."""

    #: Whether the law steers for the curvature ahead.
    ahead: ClassVar[bool] = False

    def _previews(self, scenario: PreviewScenario) -> None:
        self._samples = [c.name for c in scenario.channels if c.name.startswith("curvature_preview_")]
        steering = scenario.vehicle.steering
        self._interval = scenario.preview_interval
        self._late = steering.lag + steering.delay + 0.5 * scenario.control_step

    def _curvature(self, at: Mapping[str, Floats], time: Floats) -> Floats:
        """Return the curvature where the car will be after ``time`` s, 1/m, (n,)."""
        # Previews are spaced in time at the present speed, so the way is one in time as well.
        return curvature_ahead(np.stack([at[name] for name in self._samples], axis=1), self._interval, time)

    def _curvatures(self, at: Mapping[str, Floats]) -> tuple[Floats, Floats]:
        """Return curvature at the car and as far on as it goes while the steering answers, 1/m, (n,)."""
        here = at[self._samples[0]]
        return here, self._curvature(at, np.full_like(here, self._late)) if self.ahead else here


class WerlingLateral(_Ahead):
    """`werling-lateral`: input/output linearisation on saturating tyres above 4.5 m/s, the rolling car below 2.5."""

    name = "werling-lateral"
    reads: ClassVar[tuple[str, ...]] = (
        "lateral_error",
        "heading_error",
        "sideslip",
        "yaw_rate",
        "speed",
        "curvature_preview_0",
    )
    tuning: ClassVar[WerlingTuning] = WerlingTuning()

    def __init__(self, scenario: GripScenario) -> None:
        super().__init__(scenario)
        self._previews(scenario)
        self._car = WerlingCar.of(scenario.vehicle, scenario.friction)

    def steering(self, at: Mapping[str, Floats], car: WerlingCar | None = None) -> Floats:
        """Return the road-wheel angle asked for, rad, (n,), of ``car`` where that is another than the scenario's."""
        kappa, early = self._curvatures(at)
        state = (at[name] for name in ("lateral_error", "heading_error", "sideslip", "yaw_rate", "speed"))
        steer, _ = blended_steering(
            car or self._car, self.tuning, WerlingMeasured(*state), self._direction(at), kappa, early=early
        )
        return steer

    def _direction(self, at: Mapping[str, Floats]) -> Floats:
        """Return +1 where the car is to go forwards, -1 backwards, (n,)."""
        return np.ones_like(at["speed"])

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        return self.steering(at), None


class WerlingLateralAhead(WerlingLateral):
    """`werling-lateral-ahead`: the same for the curvature ahead; the extension."""

    name = "werling-lateral-ahead"
    uses: ClassVar[tuple[str, ...]] = ("curvature_preview_*",)
    ahead = True


class WerlingReverse(_Ahead):
    """`werling-reverse`: the rolling car's law (23) in arc length, forwards and backwards; errors of the rear axle."""

    name = "werling-reverse"
    reads = ("lateral_error", "heading_error", "speed", "curvature_preview_0")
    needs = (Need("errors of the rear axle", _lacking_rear),)
    memory = 1  # the last direction
    #: k, 1/m: with 1 the actuator's lag costs three times as much.
    wave_number: ClassVar[float] = 2.0

    def __init__(self, scenario: ReverseScenario) -> None:
        super().__init__(scenario)
        self._previews(scenario)
        self._wheelbase = scenario.vehicle.wheelbase

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        _, early = self._curvatures(at)
        direction = hold_direction(at["speed"], np.where(fresh, 1.0, memory[:, 0]))
        steer = kinematic_steering(
            self._wheelbase, self.wave_number, at["lateral_error"], at["heading_error"], direction, early
        )
        return steer, direction[:, None]


class WerlingReverseAhead(WerlingReverse):
    """`werling-reverse-ahead`: the same for the curvature ahead; the extension."""

    name = "werling-reverse-ahead"
    uses = ("curvature_preview_*",)
    ahead = True
    wave_number = 1.0
