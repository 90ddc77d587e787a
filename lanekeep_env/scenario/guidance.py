"""What a camera-guided car is told: the distance to keep from the edge, and a plan of the road with errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from lanekeep_env.checks import from_mapping, ordered, plain_numbers, require, shown
from lanekeep_env.walls.generators import range_of

#: Places of the guidance's numbers: low and high of the plan's errors, in the order of `PlanErrors`, and of the set
#: points, m; control steps between these, inf for one an episode; 1 where the right edge is seen, -1 for the left one.
OFFSET, RADIUS, ANGLE, RECOGNISED, SET_LOW, SET_HIGH, HOLD, SIDE = 0, 2, 4, 6, 8, 9, 10, 11
#: Way ahead at which a bend is in the plan where it always is, m.
_ALWAYS = 1e9
#: What the errors may be: unit, lowest and highest.
_BOUNDS = {"offset": ("m", -100.0, 100.0), "radius": ("", -0.9, 10.0), "angle": ("", -0.9, 10.0)}


@dataclass(frozen=True)
class PlanErrors:
    """Errors of the plan's bends, each a number or bounds (low, high) of which an episode draws one.

    They are those that the source expects of map and positioning (Trächtler, Lohmann, Struck 1992, section 5).

    Attributes:
        offset: m by which the plan has bends later than the road.
        radius: share by which the plan has their radii larger.
        angle: share by which the plan has their angles larger.
        recognised: m of way ahead of the rear axle at which a bend comes into the plan, negative where the car is in it
            by then; None for always.
    """

    offset: float | tuple[float, float] = 0.0
    radius: float | tuple[float, float] = 0.0
    angle: float | tuple[float, float] = 0.0
    recognised: float | tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name, (unit, low, high) in _BOUNDS.items():
            object.__setattr__(self, name, range_of(f"plan_errors.{name}", getattr(self, name), unit, low, high))
        if self.recognised is not None:
            read = range_of("plan_errors.recognised", self.recognised, "m", -100.0, 1e6)
            object.__setattr__(self, "recognised", read)

    @property
    def none(self) -> bool:
        """Whether the plan is right."""
        return self == PlanErrors()

    def numbers(self) -> np.ndarray:
        """Low and high of each, (8,)."""
        recognised = (_ALWAYS, _ALWAYS) if self.recognised is None else self.recognised
        return np.array([self.offset, self.radius, self.angle, recognised], dtype=np.float64).ravel()


@dataclass(frozen=True)
class SetPoints:
    """Distances from the edge that are to be kept, uniform between two bounds.

    Attributes:
        minimum, maximum: m.
        hold: s until the next one, None for one an episode.
    """

    minimum: float
    maximum: float
    hold: float | None = 8.0

    def __post_init__(self) -> None:
        require("set_points.minimum", self.minimum, "m", above=0.0, at_most=100.0)
        require("set_points.maximum", self.maximum, "m", above=0.0, at_most=100.0)
        ordered(self, "set_points", "minimum", "maximum")
        require("set_points.hold", self.hold, "s", above=0.0, at_most=1e6, optional=True)
        plain_numbers(self)


def plan_errors_from(value: Mapping[str, Any] | PlanErrors) -> PlanErrors:
    """Read errors of the plan: a record or a mapping of its fields; ValueError names what is wrong."""
    if isinstance(value, PlanErrors):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f"plan_errors={shown(value)} must be a mapping of PlanErrors' fields, e.g. {{'offset': 1.0}}")
    return from_mapping(PlanErrors, value, "plan_errors")


def set_points_from(value: float | Mapping[str, Any] | SetPoints | None) -> SetPoints | None:
    """Read set points: None for half the lane's width, a number, a mapping of fields, or a record."""
    if value is None or isinstance(value, SetPoints):
        return value
    if isinstance(value, Mapping):
        return from_mapping(SetPoints, value, "set_points")
    if not isinstance(value, Real):
        raise ValueError(
            f"set_points={shown(value)} must be a number in m, None or a mapping of SetPoints' fields, "
            "e.g. {'minimum': 1.2, 'maximum': 1.8}"
        )
    require("set_points", value, "m", above=0.0, at_most=100.0)
    return SetPoints(float(value), float(value), None)


def guidance_numbers(errors: PlanErrors, points: SetPoints, right: bool, step: float) -> np.ndarray:
    """Numbers for the kernel, (12,)."""
    values = np.zeros(SIDE + 1)
    values[:SET_LOW] = errors.numbers()
    values[SET_LOW:HOLD] = points.minimum, points.maximum
    values[HOLD] = np.inf if points.hold is None else max(1, round(points.hold / step))
    values[SIDE] = 1.0 if right else -1.0
    return values
