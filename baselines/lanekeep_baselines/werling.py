"""Werling, Gröll, Bretthauer 2008: the multi-controller as policies, each loop alone and the whole.

`werling-lateral` steers the centre of gravity (or, slowly, the rear axle) along a path at any speed forwards,
`werling-reverse` the rear axle in either direction, `werling-drive` does all: steering, set speeds, the car ahead, stop
points, with throttle and brake. The laws and their sources are in `werling_lateral`, `werling_longitudinal`,
`werling_drive`. The `-ahead` ones, and `werling-drive`, take the curvature ahead by what the steering actuator lags;
`werling-lateral-predictor`, in `werling_predictor`, takes the state ahead as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.policy import Floats, PreviewScenario, SteeringPolicy
from lanekeep_baselines.werling_drive import AccelerationIntegrator, EngineMap, split_range
from lanekeep_baselines.werling_lateral import (
    WerlingMeasured,
    WerlingTuning,
    blended_steering,
    curvature_ahead,
    hold_direction,
    kinematic_steering,
)
from lanekeep_baselines.werling_longitudinal import LongitudinalControl, LongitudinalTuning
from lanekeep_baselines.werling_tyres import WerlingCar
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.powertrain_parameters import Powertrain


class GripScenario(PreviewScenario, Protocol):
    """What the dynamic law may know besides: the road's friction."""

    @property
    def friction(self) -> float: ...


class DriveScenario(GripScenario, Protocol):
    """What the longitudinal control may know besides; `lanekeep_env.DriveScenario` is one."""

    @property
    def powertrain(self) -> Powertrain: ...


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

    def steering(self, at: Mapping[str, Floats]) -> Floats:
        """Return the road-wheel angle asked for, rad, (n,)."""
        kappa, early = self._curvatures(at)
        state = (at[name] for name in ("lateral_error", "heading_error", "sideslip", "yaw_rate", "speed"))
        steer, _ = blended_steering(
            self._car, self.tuning, WerlingMeasured(*state), np.ones_like(kappa), kappa, early=early
        )
        return steer

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        return self.steering(at), None


class WerlingLateralAhead(WerlingLateral):
    """`werling-lateral-ahead`: the same for the curvature ahead; the extension."""

    name = "werling-lateral-ahead"
    uses = ("curvature_preview_*",)
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


class WerlingDrive(WerlingLateralAhead):
    """`werling-drive`: the whole multi-controller, steering and pedal.

    The least acceleration that speed, gap and stop law ask for goes through the inverse of the engine's map to throttle
    or brake, with an integrator for wind and slope. A car that stands, and is not to start, is held by the brake.
    """

    name = "werling-drive"
    reads = (
        *WerlingLateral.reads,
        "acceleration",
        "gear",
        "set_speed",
        "lead_gap",
        "lead_speed",
        "stop_gap",
    )
    actions = 2
    longitudinal: ClassVar[LongitudinalTuning] = LongitudinalTuning()
    #: Of the acceleration's integrator, 1/s.
    integration: ClassVar[float] = 0.8
    #: Below this speed (m/s) and this wanted acceleration (m/s²) the car stands; brake that holds it, share.
    stands: ClassVar[tuple[float, float]] = (0.02, 0.1)
    holding: ClassVar[float] = 0.2

    def __init__(self, scenario: DriveScenario) -> None:
        super().__init__(scenario)
        self._laws = LongitudinalControl(self.longitudinal)
        self._integrator = AccelerationIntegrator(self.integration, scenario.control_step)
        self.memory = self._laws.memory + self._integrator.memory
        self._train, self._mass = scenario.powertrain, scenario.vehicle.mass
        self._far = next(c.high for c in scenario.channels if c.name == "lead_gap")
        train = self._train
        speeds = np.linspace(train.idle_speed, train.idle_speed + 600.0, 60)
        # Never quite nothing: an engine without drag has no inverse where the throttle does nothing.
        full = train.peak_torque * np.maximum(1.0 - ((speeds - train.peak_speed) / train.torque_width) ** 2, 1e-6)
        drag = train.drag_torque + train.drag_slope * speeds
        self._engine = EngineMap(
            speeds, np.array([0.0, 1.0]), np.stack([-drag, full], axis=1) * train.efficiency / self._mass
        )
        self._ratios = np.array(train.gears) * train.final_drive / train.wheel_radius

    def pedal(self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool) -> tuple[Floats, Floats]:
        """Return the pedal, throttle positive, brake negative, (n,), and the next memory."""
        train, v, split = self._train, at["speed"], self._laws.memory
        gap = np.where(at["lead_gap"] >= self._far, np.inf, at["lead_gap"])
        stop = np.where(at["stop_gap"] >= self._far, np.inf, at["stop_gap"])
        wanted, laws = self._laws.step(v, at["set_speed"], gap, at["lead_speed"] - v, stop, memory[:, :split], fresh)
        asked = self._integrator.asked(wanted, memory[:, split:], fresh)
        gear = np.clip(at["gear"], 0, len(self._ratios) - 1).astype(np.intp)
        ratio = self._ratios[gear]
        resistance = 0.6 * train.drag_area * v * v / self._mass + GRAVITY * train.rolling
        resistance = resistance - train.creep * np.clip(1.0 - v / train.creep_speed, 0.0, 1.0)
        engine_speed = np.maximum(v * ratio, train.idle_speed)
        found = split_range(self._engine, asked, engine_speed, ratio, resistance, train.brake, 1.0)
        # On the slipping converter a closed throttle does not drag: the brake does all.
        slips = (v * ratio < train.idle_speed) & (asked + resistance <= 0.0)
        brake = np.where(slips, np.clip(-(asked + resistance) / train.brake, 0.0, 1.0), found.pressure)
        expected = np.where(slips, -train.brake * brake - resistance, found.expected)
        standing = (v < self.stands[0]) & (wanted < self.stands[1])
        pedal = np.where(brake > 0.0, -brake, found.throttle)
        pedal = np.where(standing, np.minimum(pedal, -self.holding), pedal)
        state = self._integrator.advance(
            wanted, at["acceleration"], asked, expected, standing, memory[:, split:], fresh
        )
        return pedal, np.concatenate([laws, state], axis=1)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        pedal, following = self.pedal(at, memory, fresh)
        return np.stack([self.steering(at), pedal], axis=1), following

    def _action(self, command: Floats, at: Mapping[str, Floats]) -> Floats:
        return np.concatenate([super()._action(command[:, 0], at), command[:, 1:]], axis=1)
