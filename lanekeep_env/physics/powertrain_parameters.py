"""Powertrains: engine, gearbox, brake and resistances of a car, with their sources."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import plain_numbers, record_from, require, require_line, shown

#: Longitudinal acceleration beyond which a powertrain is none, m/s².
LARGEST_PULL = 100.0

#: Unit, smallest and largest value of each number.
_BOUNDS = {
    "peak_torque": ("N m", 1e-4, 1e5),
    "peak_speed": ("rad/s", 1.0, 1e5),
    "torque_width": ("rad/s", 1.0, 1e5),
    "drag_torque": ("N m", 0.0, 1e4),
    "drag_slope": ("N m s/rad", 0.0, 1e3),
    "idle_speed": ("rad/s", 1e-3, 1e4),
    "final_drive": ("", 1e-3, 1e3),
    "efficiency": ("", 1e-3, 1.0),
    "wheel_radius": ("m", 1e-3, 10.0),
    "drag_area": ("m²", 0.0, 100.0),
    "rolling": ("", 0.0, 1.0),
    "creep": ("m/s²", 0.0, 10.0),
    "creep_speed": ("m/s", 1e-2, 100.0),
    "brake": ("m/s²", 1e-3, 100.0),
    "pedal_lag": ("s", 0.0, 100.0),
    "upshift": ("rad/s", 1e-3, 1e5),
    "upshift_full": ("rad/s", 1e-3, 1e5),
    "part_throttle": ("", 0.01, 0.99),
    "downshift": ("rad/s", 1e-3, 1e5),
    "downshift_throttle": ("rad/s", 0.0, 1e5),
    "kick_down": ("rad/s", 1e-3, 1e5),
    "kick_down_throttle": ("", 0.01, 1.0),
    "reserve": ("m/s²", 0.0, 10.0),
    "rev_limit": ("rad/s", 1.0, 1e5),
    "reverse": ("", 1e-3, 1e3),
    "shift_time": ("s", 0.0, 60.0),
}


@dataclass(frozen=True)
class Powertrain:
    """Engine, automatic gearbox, brake and resistances (SI units).

    Attributes:
        name: what tables call it.
        peak_torque, peak_speed: largest torque, N m, and the engine speed at it, rad/s.
        torque_width: from there to the speeds without torque, rad/s (full load is a parabola).
        drag_torque, drag_slope: of the closed throttle, N m and N m s/rad.
        idle_speed: of the engine, rad/s.
        gears: ratios of the gears, first to last.
        final_drive: ratio.
        efficiency: of gears and final drive.
        wheel_radius: m.
        drag_area: air drag coefficient times frontal area, m².
        rolling: resistance over weight.
        creep: acceleration at standstill with released pedals, m/s², falling to none at ``creep_speed`` (m/s), in every
            gear: were it the first one's alone, the car would jerk as it shifts down before it stops.
        brake: deceleration of the full brake, m/s².
        pedal_lag: of throttle and brake, s.
        upshift, upshift_full: engine speed at which the gearbox shifts up, rad/s, up to ``part_throttle`` and at full
            throttle, linear between.
        part_throttle: throttle up to which it shifts early.
        downshift, downshift_throttle: engine speed in the gear below under which the gearbox shifts down, rad/s, and
            what full throttle adds.
        kick_down: beyond the throttle ``kick_down_throttle`` the gearbox shifts down as long as the engine stays below
            this speed, rad/s.
        reserve: acceleration that the next gear must have left at full load before the gearbox shifts up, m/s²; and
            it must be able to go on with the present one (and, once it had to shift down, with as much more), but
            beyond ``upshift_full``. So load counts: uphill and against the wind it stays in the gear that it needs.
        rev_limit: engine speed from which on the limiter takes the torque away (over 20 rad/s), rad/s.
        reverse: ratio of the reverse gear.
        shift_time: without torque, s.
        hold_time: from one gear change to the next at least, s.
        settle_time: from one gear change to one the other way at least, s. A car that stands is in first at once.
    """

    name: str = "passat"
    peak_torque: float = 200.0
    peak_speed: float = 366.0
    torque_width: float = 740.0
    drag_torque: float = 20.0
    drag_slope: float = 0.05
    idle_speed: float = 80.0
    gears: tuple[float, ...] = (4.148, 2.370, 1.556, 1.155, 0.859, 0.686)
    final_drive: float = 3.87
    efficiency: float = 0.92
    wheel_radius: float = 0.316
    drag_area: float = 0.66
    rolling: float = 0.012
    creep: float = 0.6
    creep_speed: float = 2.0
    brake: float = 9.0
    pedal_lag: float = 0.1
    upshift: float = 145.0
    upshift_full: float = 628.0
    part_throttle: float = 0.75
    downshift: float = 80.0
    downshift_throttle: float = 30.0
    kick_down: float = 540.0
    kick_down_throttle: float = 0.95
    reserve: float = 0.3
    rev_limit: float = 680.0
    reverse: float = 3.394
    shift_time: float = 0.05
    hold_time: float = 0.5
    settle_time: float = 3.0

    def __post_init__(self) -> None:
        require_line("powertrain.name", self.name)
        if not isinstance(self.gears, tuple | list) or not 1 <= len(self.gears) <= at.GEARS_MOST:
            raise ValueError(f"powertrain.gears={shown(self.gears)} is not allowed: 1 to {at.GEARS_MOST} ratios")
        for ratio in self.gears:
            require("powertrain.gears", ratio, "", at_least=1e-3, at_most=1e3)
        object.__setattr__(self, "gears", tuple(float(ratio) for ratio in self.gears))
        if any(after >= before for before, after in zip(self.gears[:-1], self.gears[1:], strict=True)):
            raise ValueError(f"powertrain.gears={shown(self.gears)} is not allowed: the ratios must fall")
        for name, (unit, low, high) in _BOUNDS.items():
            require(f"powertrain.{name}", getattr(self, name), unit, at_least=low, at_most=high)
        require("powertrain.downshift", self.downshift, "rad/s", at_most=self.upshift)
        require("powertrain.upshift", self.upshift, "rad/s", at_most=self.upshift_full)
        require("powertrain.kick_down", self.kick_down, "rad/s", at_most=self.upshift_full)
        require("powertrain.hold_time", self.hold_time, "s", at_least=self.shift_time, at_most=600.0)
        require("powertrain.settle_time", self.settle_time, "s", at_least=self.hold_time, at_most=600.0)
        plain_numbers(self)

    def check(self, mass: float) -> None:
        """Raise ValueError where gears and brake ask for more than any car of ``mass`` (kg) can do."""
        pull = self.peak_torque * max(*self.gears, self.reverse) * self.final_drive / (self.wheel_radius * mass)
        if pull > LARGEST_PULL:
            raise ValueError(
                f"powertrain.peak_torque={self.peak_torque!r} is not allowed: in the first gear that is {pull:.3g} "
                f"m/s² for a car of {mass:g} kg; it must be <= {self.peak_torque * LARGEST_PULL / pull:.3g} N m"
            )

    def numbers(self, step: float) -> np.ndarray:
        """What the kernel needs, for an integration step in s, (`layout.DRIVE_SIZE`,)."""
        values = np.zeros(at.DRIVE_SIZE)
        values[: at.D_RATIOS] = (
            self.peak_torque,
            self.peak_speed,
            1.0 / self.torque_width,
            self.drag_torque,
            self.drag_slope,
            self.idle_speed,
            self.efficiency,
            0.5 * 1.2 * self.drag_area,
            self.rolling,
            self.creep,
            1.0 / self.creep_speed,
            self.brake,
            1.0 - math.exp(-step / self.pedal_lag) if self.pedal_lag > 0.0 else 1.0,
            self.upshift,
            self.upshift_full,
            self.part_throttle,
            self.downshift,
            self.downshift_throttle,
            self.kick_down_throttle,
            self.kick_down,
            self.reserve,
            self.rev_limit,
            round(self.shift_time / step),
            round(self.hold_time / step),
            round(self.settle_time / step),
            self.reverse * self.final_drive / self.wheel_radius,
            len(self.gears),
        )
        for gear, ratio in enumerate(self.gears):
            values[at.D_RATIOS + gear] = ratio * self.final_drive / self.wheel_radius
        return values


#: VW Passat Variant 2.0 FSI: 110 kW at 6,000/min, 200 N m at 3,500/min, six-speed automatic 09G with its ratios,
#: reverse 3.394 (maker's figures). Two numbers follow from Figure 10, where the car gains 8.4 m/s in 8.5 s with no more
#: than 1 m/s² and shifts three times on the way: the third before 160 rad/s, and with hardly any time without torque,
#: as an automatic shifts under load. Stated here as those of such a car, since the article gives none: drag, rolling,
#: creep, brake, other times, the limiter at 6,500/min, kick-down up to 5,150/min; full throttle shifts at rated power.
POWERTRAINS = {"passat": Powertrain()}


def powertrain_from(value: str | Mapping[str, Any] | Powertrain) -> Powertrain:
    """Read a powertrain: a name, a mapping of fields, or a record; ValueError names what is wrong."""
    return record_from(Powertrain, value, "powertrain", POWERTRAINS)
