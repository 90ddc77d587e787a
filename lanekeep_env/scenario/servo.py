"""A servo that turns the road wheels: what it makes of a command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_env.checks import from_mapping, plain_numbers, require, shown


@dataclass(frozen=True)
class Servo:
    """What a servo makes of a command, each off by default; it counts in ticks from -50 to 50.

    Attributes:
        left, right: road-wheel angle at full command to either side, rad; None for `max_steering_angle`.
        angles: measured road-wheel angles at uniformly spaced commands from full right to full left, rad, an odd
            number of them (21 for half circles driven every 5 ticks); instead of left and right.
        ticks: steps of a command from zero to full, 0 for a continuous one.
    """

    left: float | None = None
    right: float | None = None
    angles: tuple[float, ...] | None = None
    ticks: int = 0

    def __post_init__(self) -> None:
        for name in ("left", "right"):
            require(f"servo.{name}", getattr(self, name), "rad", above=0.0, at_most=1.5, optional=True)
        require("servo.ticks", self.ticks, "", at_least=0, at_most=1_000_000, whole=True)
        if self.angles is not None:
            if not isinstance(self.angles, tuple | list):
                raise ValueError(
                    f"servo.angles={shown(self.angles)} is not allowed: an odd number of angles, at least 3, rad"
                )
            for angle in self.angles:
                require("servo.angles", angle, "rad", at_least=-1.5, at_most=1.5)
            object.__setattr__(self, "angles", tuple(float(angle) for angle in self.angles))
            if len(self.angles) < 3 or len(self.angles) % 2 == 0 or self.left is not None or self.right is not None:
                raise ValueError(
                    f"servo.angles={shown(self.angles)} is not allowed: an odd number of angles, at least 3, "
                    "and neither left nor right beside them"
                )
            if any(after <= before for before, after in zip(self.angles[:-1], self.angles[1:], strict=True)):
                raise ValueError(
                    f"servo.angles={shown(self.angles)} is not allowed: the angles must rise from right to left"
                )
        plain_numbers(self)

    def table(self, largest: float) -> np.ndarray | None:
        """Numbers for the kernel (command quantum, then angles), or None for a servo that does as it is told."""
        if self == Servo():
            return None
        angles = self.angles or (
            -(largest if self.right is None else self.right),
            0.0,
            largest if self.left is None else self.left,
        )
        return np.array([1.0 / self.ticks if self.ticks else 0.0, *angles])


def servo_from(value: Mapping[str, Any] | Servo | None) -> Servo:
    """Read a servo: None (does as it is told), a mapping of fields, or a record; ValueError names what is wrong."""
    if value is None:
        return Servo()
    if isinstance(value, Servo):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f"servo={shown(value)} must be a mapping of Servo's fields")
    return from_mapping(Servo, value, "servo")
