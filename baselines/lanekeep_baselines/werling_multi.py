"""Werling, Gröll, Bretthauer 2008: the multi-controller as one policy, `werling-drive`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.werling import GripScenario, WerlingLateral, WerlingLateralAhead
from lanekeep_baselines.werling_drive import AccelerationIntegrator, EngineMap, split_range
from lanekeep_baselines.werling_longitudinal import LongitudinalControl, LongitudinalTuning
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.powertrain_parameters import Powertrain


class DriveScenario(GripScenario, Protocol):
    """What the longitudinal control may know besides; `lanekeep_env.DriveScenario` is one."""

    @property
    def powertrain(self) -> Powertrain: ...


class Pedals(NamedTuple):
    """Pedal, throttle positive, brake negative; the acceleration (m/s²) that the model expects; resistances (m/s²)."""

    pedal: Floats
    expected: Floats
    resistance: Floats


class WerlingDrive(WerlingLateralAhead):
    """`werling-drive`: the whole multi-controller, steering and pedal.

    The least acceleration that speed, gap and stop law ask for goes through the inverse of the engine's map to throttle
    or brake, with an integrator for wind and slope. A car that stands, and is not to start, is held by the brake.
    Backwards, where the set speed is negative, all laws hold in that direction.

    The integrator compares what is measured with what the model expects behind the pedals' lag; while a gear change
    interrupts the torque, and until the pedals have followed, it stands still: nothing winds up.
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
    #: c_v is that with which the speed law takes over at Figure 10's 12.5 s, gear changes included.
    longitudinal: ClassVar[LongitudinalTuning] = LongitudinalTuning(speed_rate=0.49)
    #: Of the acceleration's integrator, 1/s.
    integration: ClassVar[float] = 0.8
    #: Below this speed (m/s) and this wanted acceleration (m/s²) the car stands; brake that holds it, share.
    stands: ClassVar[tuple[float, float]] = (0.02, 0.1)
    holding: ClassVar[float] = 0.2
    #: Lags of the pedals after a gear change until acceleration is what it is expected to be again.
    settled: ClassVar[float] = 3.0

    def __init__(self, scenario: DriveScenario) -> None:
        super().__init__(scenario)
        self._laws = LongitudinalControl(self.longitudinal)
        self._integrator = AccelerationIntegrator(self.integration, scenario.control_step)
        # Behind the laws' and the integrator's: what the pedals are due to give behind their lag, m/s², the last gear,
        # and the time for which the integrator stands still, s.
        self.memory = self._laws.memory + self._integrator.memory + 3
        self._train, self._mass, self._step = scenario.powertrain, scenario.vehicle.mass, scenario.control_step
        self._far = next(c.high for c in scenario.channels if c.name == "lead_gap")
        train = self._train
        speeds = np.linspace(train.idle_speed, train.idle_speed + 600.0, 60)
        # Never quite nothing: an engine without drag has no inverse where the throttle does nothing.
        full = train.peak_torque * np.maximum(1.0 - ((speeds - train.peak_speed) / train.torque_width) ** 2, 1e-6)
        drag = train.drag_torque + train.drag_slope * speeds
        self._engine = EngineMap(
            speeds, np.array([0.0, 1.0]), np.stack([-drag, full], axis=1) * train.efficiency / self._mass
        )
        self._ratios = np.array([*train.gears, train.reverse]) * train.final_drive / train.wheel_radius

    def _direction(self, at: Mapping[str, Floats]) -> Floats:
        return np.where(at["gear"] < -0.5, -1.0, 1.0)

    def _pedals(self, v: Floats, asked: Floats, gear: NDArray[np.intp]) -> Pedals:
        """Return what gives the acceleration ``asked``, m/s², at ``v`` m/s in a gear, -1 for reverse, (n,)."""
        train, ratio = self._train, self._ratios[gear]
        resistance = 0.6 * train.drag_area * v * v / self._mass + GRAVITY * train.rolling
        resistance = resistance - train.creep * np.clip(1.0 - v / train.creep_speed, 0.0, 1.0)
        engine_speed = np.maximum(v * ratio, train.idle_speed)
        found = split_range(self._engine, asked, engine_speed, ratio, resistance, train.brake, 1.0)
        # On the slipping converter a closed throttle does not drag: the brake does all.
        slips = (v * ratio < train.idle_speed) & (asked + resistance <= 0.0)
        brake = np.where(slips, np.clip(-(asked + resistance) / train.brake, 0.0, 1.0), found.pressure)
        expected = np.where(slips, -train.brake * brake - resistance, found.expected)
        return Pedals(np.where(brake > 0.0, -brake, found.throttle), expected, resistance)

    def pedal(self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool) -> tuple[Floats, Floats]:
        """Return the pedal, throttle positive, brake negative, (n,), and the next memory."""
        way, split = self._direction(at), self._laws.memory
        v, measured = way * at["speed"], way * at["acceleration"]
        gap = np.where(at["lead_gap"] >= self._far, np.inf, at["lead_gap"])
        stop = np.where(at["stop_gap"] >= self._far, np.inf, at["stop_gap"])
        set_speed = np.maximum(way * at["set_speed"], 0.0)
        wanted, laws = self._laws.step(v, set_speed, gap, at["lead_speed"] - v, stop, memory[:, :split], fresh)
        # Slope and wind are kept as they are forwards: backwards they push the other way.
        state, (before, last, held) = way[:, None] * memory[:, split : split + 1], memory[:, split + 1 :].T
        asked = self._integrator.asked(wanted, state, fresh)
        gear = np.clip(np.rint(at["gear"]), -1, len(self._train.gears) - 1).astype(np.intp)
        found = self._pedals(v, asked, gear)
        rest = self._train.shift_time + self.settled * self._train.pedal_lag
        held = np.where(fresh, 0.0, np.where(gear == last, np.maximum(held - self._step, 0.0), rest))
        standing = (v < self.stands[0]) & (wanted < self.stands[1])
        pedal = np.where(standing, np.minimum(found.pedal, -self.holding), found.pedal)
        # What the pedals of the steps before give by now; the rest of what is measured is slope and wind.
        before = np.where(fresh, measured + found.resistance, before)
        due = before - found.resistance - np.where(fresh, 0.0, state[:, 0])
        still = (v < self.stands[0]) | (held > 0.0)
        state = self._integrator.advance(due, measured, asked, found.expected, still, state, fresh)
        lag = self._train.pedal_lag
        share = 1.0 - np.exp(-self._step / lag) if lag > 0.0 else 1.0
        given = np.where(standing, -self._train.brake * self.holding, found.expected + found.resistance)
        before = before + share * (given - before)
        return pedal, np.concatenate([laws, way[:, None] * state, np.stack([before, gear, held], axis=1)], axis=1)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        pedal, following = self.pedal(at, memory, fresh)
        return np.stack([self.steering(at), pedal], axis=1), following

    def _action(self, command: Floats, at: Mapping[str, Floats]) -> Floats:
        return np.concatenate([super()._action(command[:, 0], at), command[:, 1:]], axis=1)
