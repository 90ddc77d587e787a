"""Speed on a road: constant, as fast as lateral and longitudinal acceleration allow, or set speeds in time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from numbers import Real
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import from_mapping, ordered, plain_numbers, require, shown
from lanekeep_env.roads.road import Floats, Road


class _AlongRoad:
    """What speeds share that belong to places of a road."""

    @property
    def lateral_limit(self) -> float:
        """Largest lateral acceleration, m/s², 0 for none."""
        return 0.0

    def numbers(self, control_step: float, step: float) -> dict[int, float]:
        """No settings of the kernel: the speed is the road's."""
        return {}


@dataclass(frozen=True)
class ConstantSpeed(_AlongRoad):
    """The same speed everywhere.

    Attributes:
        speed: m/s, 0 allowed.
    """

    speed: float

    def __post_init__(self) -> None:
        require("speed", self.speed, "m/s", at_least=0.0, at_most=100.0)
        plain_numbers(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as JSON-able values."""
        return asdict(self)

    @property
    def largest(self) -> float:
        """Largest speed, m/s."""
        return self.speed

    def along(self, road: Road, minimum: float | None = None) -> tuple[Road, Floats]:
        """Return the road and the speed at its segment borders, m/s, (n + 1,)."""
        road = road.refined(100.0)  # so that positions stay exact in float32, and starts have places to be at
        return road, np.full(len(road.lengths) + 1, float(self.speed))


@dataclass(frozen=True)
class LimitedSpeed(_AlongRoad):
    """Speed under a limit of lateral acceleration, reached and left with limited longitudinal acceleration.

    Attributes:
        lateral_acceleration: largest v² |curvature|, m/s² (0.4 g as in Yin 2010).
        maximum: m/s (180 km/h as in Yin 2010).
        minimum: m/s, kept even where the lateral limit asks for less; None for the road's own (Yin's
            road: 68 km/h, all others none).
        acceleration, deceleration: largest longitudinal ones, m/s², both positive.
        friction_ellipse: whether longitudinal and lateral acceleration stay within the ellipse of their limits, and not
            each below its own; friction then bounds all three. Always with ``tyre="load_sensitive"``.
    """

    lateral_acceleration: float = 0.4 * 9.81
    maximum: float = 50.0
    minimum: float | None = None
    acceleration: float = 2.0
    deceleration: float = 3.0
    friction_ellipse: bool = False

    def __post_init__(self) -> None:
        require("speed.lateral_acceleration", self.lateral_acceleration, "m/s²", at_least=1e-3, at_most=1000.0)
        require("speed.maximum", self.maximum, "m/s", above=0.0, at_most=100.0)
        require("speed.minimum", self.minimum, "m/s", above=0.0, at_most=100.0, optional=True)
        ordered(self, "speed", "minimum", "maximum")
        require("speed.acceleration", self.acceleration, "m/s²", at_least=1e-3, at_most=1e5)
        require("speed.deceleration", self.deceleration, "m/s²", at_least=1e-3, at_most=1e5)
        if not isinstance(self.friction_ellipse, bool):
            raise ValueError(
                f"speed.friction_ellipse={shown(self.friction_ellipse)} is not allowed: it must be True or False"
            )
        plain_numbers(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as JSON-able values."""
        return asdict(self)

    @property
    def largest(self) -> float:
        """Largest speed, m/s."""
        return self.maximum

    @property
    def lateral_limit(self) -> float:
        """Largest lateral acceleration, m/s², 0 for none; with the ellipse the largest of any direction."""
        if self.friction_ellipse:
            return max(self.lateral_acceleration, self.acceleration, self.deceleration)
        return self.lateral_acceleration

    def along(self, road: Road, minimum: float | None = None) -> tuple[Road, Floats]:
        """Return the road, cut finely enough, and the speed at its segment borders, m/s, (n + 1,).

        v² is linear in arc length inside a segment (constant acceleration), curvature as well; a border is
        held to the tightest curvature of both segments that meet there, so that v² |curvature| stays
        within the limit everywhere and not at the borders only.
        """
        changing = road.curvature_start != road.curvature_end
        road = road.refined(np.where(changing, 12.0, 30.0))
        tightest = np.maximum(np.abs(road.curvature_start), np.abs(road.curvature_end))
        with np.errstate(divide="ignore"):
            limit = np.minimum(self.maximum**2, self.lateral_acceleration / tightest)
        floor = self.minimum if self.minimum is not None else min(minimum or 0.0, self.maximum)
        limit = np.maximum(limit, floor**2)
        # A closed road is driven three times round; the middle lap knows what comes before and behind.
        laps = 3 if road.closed else 1
        limit = np.tile(limit, laps)
        border = np.minimum(np.append(limit, limit[-1]), np.append(limit[0], limit))
        lengths = np.tile(road.lengths, laps)
        if self.friction_ellipse:
            bend = np.tile((tightest / self.lateral_acceleration) ** 2, laps)
            border = _within_ellipse(border[::-1], 2.0 * self.deceleration * lengths[::-1], bend[::-1])[::-1]
            border = _within_ellipse(border, 2.0 * self.acceleration * lengths, bend)
        else:
            station = np.concatenate([[0.0], np.cumsum(lengths)])
            brake = 2.0 * self.deceleration * station
            border = np.minimum.accumulate((border + brake)[::-1])[::-1] - brake
            gain = 2.0 * self.acceleration * station
            border = np.minimum.accumulate(border - gain) + gain
        n = len(road.lengths)
        squared = border[n : 2 * n + 1] if road.closed else border
        return road, np.sqrt(squared)


def _within_ellipse(squared: Floats, most: Floats, bend: Floats) -> Floats:
    """Return the squared speeds (n + 1,), m²/s², lowered so that none is gained faster than the ellipse allows.

    ``most`` (n,) is what a segment gains without lateral acceleration, ``bend`` (n,) its (curvature / limit)², s⁴/m⁴.
    From w to W: ((W - w)/most)² + bend W² <= 1, at the segment's end, where the lateral acceleration is largest.
    """
    result = squared.copy()
    for i, (reach, a) in enumerate(zip(most.tolist(), bend.tolist(), strict=True)):
        w, b = result[i], 1.0 / (reach * reach)
        end = (b * w + math.sqrt(max(a + b - a * b * w * w, 0.0))) / (a + b)
        result[i + 1] = min(result[i + 1], max(end, w))
    return result


@dataclass(frozen=True)
class SetSpeeds:
    """Set speeds in time, drawn anew every while; the car goes from one to the next with a limited acceleration.

    Attributes:
        minimum, maximum: between which a set speed is drawn, m/s. A negative minimum, of paths that are driven both
            ways, makes some of them the other way.
        hold: s from one set speed to the next, a multiple of the control step; None for one an episode.
        standstill: share of set speeds that are 0.
        acceleration: largest change of speed, m/s², either way.
        lateral_acceleration: largest v² |curvature|, m/s²: the car slows down before bends; None for no limit.
    """

    minimum: float = 0.0
    maximum: float = 6.0
    hold: float | None = 8.0
    standstill: float = 0.1
    acceleration: float = 1.5
    lateral_acceleration: float | None = 2.5

    def __post_init__(self) -> None:
        require("speed.maximum", self.maximum, "m/s", at_least=0.0, at_most=100.0)
        require("speed.minimum", self.minimum, "m/s", at_least=-100.0, at_most=100.0)
        ordered(self, "speed", "minimum", "maximum")
        require("speed.hold", self.hold, "s", above=0.0, at_most=1e6, optional=True)
        require("speed.standstill", self.standstill, "(a share)", at_least=0.0, at_most=1.0)
        require("speed.acceleration", self.acceleration, "m/s²", at_least=1e-3, at_most=1e5)
        require(
            "speed.lateral_acceleration",
            self.lateral_acceleration,
            "m/s²",
            at_least=1e-3,
            at_most=1000.0,
            optional=True,
        )
        plain_numbers(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as JSON-able values."""
        return asdict(self)

    @property
    def largest(self) -> float:
        """Largest speed, m/s."""
        return max(self.maximum, -self.minimum)

    @property
    def lateral_limit(self) -> float:
        """Largest lateral acceleration, m/s², 0 for none."""
        return self.lateral_acceleration or 0.0

    @property
    def varies(self) -> bool:
        """Whether set speeds differ."""
        return self.standstill < 1.0 and self.maximum > 0.0 and (self.minimum < self.maximum or self.standstill > 0.0)

    def numbers(self, control_step: float, step: float) -> dict[int, float]:
        """The kernel's settings by row of `layout`, for a control step and an integration step in s."""
        return {
            at.SPEED_LOW: self.minimum,
            at.SPEED_HIGH: self.maximum,
            at.SPEED_HOLD: math.inf if self.hold is None else round(self.hold / control_step),
            at.SPEED_CHANGE: self.acceleration * step,
            at.STANDSTILL: self.standstill,
        }

    def along(self, road: Road, minimum: float | None = None) -> tuple[Road, Floats]:
        """Return the road and the largest speed at its segment borders, m/s, (n + 1,)."""
        if self.lateral_acceleration is None or self.maximum == 0.0:
            return ConstantSpeed(self.maximum).along(road)
        limit = LimitedSpeed(
            self.lateral_acceleration, self.maximum, acceleration=self.acceleration, deceleration=self.acceleration
        )
        return limit.along(road)


@dataclass(frozen=True)
class FileSpeed(_AlongRoad):
    """The speed that a road's file gives beside its points.

    Attributes:
        maximum: m/s, which it is lowered to; None for the file's own.
    """

    maximum: float | None = None

    def __post_init__(self) -> None:
        require("speed.maximum", self.maximum, "m/s", above=0.0, at_most=100.0, optional=True)
        plain_numbers(self)

    def to_dict(self) -> dict[str, Any]:
        """Return what `speed_from` reads back, as JSON-able values."""
        return {"kind": "file", "maximum": self.maximum}

    @property
    def largest(self) -> float:
        """Largest speed, m/s."""
        return 100.0 if self.maximum is None else self.maximum

    def along(self, road: Road, minimum: float | None = None) -> tuple[Road, Floats]:
        """Return the road and the speed at its segment borders, m/s, (n + 1,)."""
        given = None if road.beside is None else road.beside[np.isfinite(road.beside[:, 3])]
        if given is None or not len(given):
            raise ValueError(f"speed='file' is not allowed: road {road.name!r} comes without speeds (a column vx_mps)")
        road = road.refined(12.0)
        speeds = np.interp(road.stations, given[:, 0], given[:, 3], period=road.length if road.closed else None)
        return road, np.minimum(speeds, self.largest)


def lap_time(road: Road, speed: Floats) -> float:
    """Seconds for one pass of ``road`` at the speeds of its segment borders (n + 1,), m/s, v² linear in between."""
    with np.errstate(divide="ignore"):
        return float(np.sum(2 * np.asarray(road.lengths) / (speed[:-1] + speed[1:])))


SpeedSpec = ConstantSpeed | LimitedSpeed | FileSpeed | SetSpeeds


def set_speeds_from(value: float | Mapping[str, Any] | SetSpeeds) -> SetSpeeds:
    """Read set speeds: m/s (that speed throughout), a mapping of `SetSpeeds`, or a record; ValueError if neither."""
    if isinstance(value, SetSpeeds):
        return value
    if isinstance(value, Mapping):
        return from_mapping(SetSpeeds, value, "speed")
    if isinstance(value, Real) and not isinstance(value, bool):
        require("speed", value, "m/s", at_least=0.0, at_most=100.0)
        speed = float(value)
        return SetSpeeds(speed, speed, hold=None, standstill=0.0, lateral_acceleration=None)
    raise ValueError(f"speed={shown(value)} must be a number in m/s or a mapping of SetSpeeds' fields")


def speed_from(value: float | str | Mapping[str, Any] | SpeedSpec | None) -> SpeedSpec:
    """Read a speed: m/s, a mapping of `LimitedSpeed` (or ``{"speed": m/s}``), "file", a record, or None (default).

    Raises:
        ValueError: not one of these, an unknown field, or a value out of range.
    """
    if value is None:
        return LimitedSpeed()
    if isinstance(value, ConstantSpeed | LimitedSpeed | FileSpeed):
        return value
    if isinstance(value, str) and value == "file":
        return FileSpeed()
    if isinstance(value, Mapping):
        if value.get("kind") == "file":
            return from_mapping(FileSpeed, {key: one for key, one in value.items() if key != "kind"}, "speed")
        if "speed" in value:
            return from_mapping(ConstantSpeed, value, "speed")
        return from_mapping(LimitedSpeed, value, "speed")
    if isinstance(value, Real) and not isinstance(value, bool):
        return ConstantSpeed(value)  # type: ignore[arg-type]
    raise ValueError(f"speed={shown(value)} must be a number in m/s, 'file' or a mapping of LimitedSpeed's fields")
