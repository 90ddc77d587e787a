"""A driven run: what was measured, sample by sample, checked and kept in a small file."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_env.checks import require, shown
from lanekeep_env.plain import read_arrays

#: Shortest run, s, and fewest samples.
SHORTEST = 5.0
FEWEST_SAMPLES = 100
#: The single-track model divides by the speed: slowest run, m/s.
SLOWEST = 2.0

#: Bytes that a run's file may have: five hours of all measurements at 100 Hz.
LARGEST_FILE = 1 << 27

_REQUIRED = ("speed", "yaw_rate")
_OPTIONAL = ("command", "steering", "heading", "x", "y")


class UnusableRun(ValueError):
    """A run from which nothing, or not everything that was asked for, can be identified; the message says why."""


@dataclass(frozen=True, eq=False)
class DrivenRun:
    """Evenly sampled measurements of one drive; SI units, angles + left, arrays of shape (samples,).

    Attributes:
        step: time between samples, s.
        speed: m/s.
        yaw_rate: rad/s.
        command: steering angle asked for from each sample to the next, rad; None for a human driver.
        steering: measured steering angle, rad; None if there is a command and no sensor.
        heading: rad, unwrapped when read, or None.
        x, y: position, m, or None. On a straight road along x, ``y`` alone is the lateral position.
        steering_ratio: of ``command`` and ``steering`` over the road-wheel angle: 1 if they are road wheel.
        delay: s by which a command arrives late, known; it is not identified.
    """

    step: float
    speed: Floats
    yaw_rate: Floats
    command: Floats | None = None
    steering: Floats | None = None
    heading: Floats | None = None
    x: Floats | None = None
    y: Floats | None = None
    steering_ratio: float = 1.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        require("step", self.step, "s", above=0.0, at_most=0.5)
        require("steering_ratio", self.steering_ratio, "", above=0.0)
        require("delay", self.delay, "s", at_least=0.0, at_most=2.0)
        count = len(np.atleast_1d(np.asarray(self.speed)))
        for name in (*_REQUIRED, *_OPTIONAL):
            given = getattr(self, name)
            if given is None and name in _OPTIONAL:
                continue
            values = np.array(given, dtype=np.float64)
            if values.shape != (count,):
                raise UnusableRun(
                    f"{name} has shape {values.shape}; it must have one number a sample of speed: ({count},)"
                )
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                raise UnusableRun(
                    f"{name} is {values[bad[0]]} at sample {bad[0]} ({bad[0] * self.step:g} s), {len(bad)} times; "
                    "cut the run there or fill the gap"
                )
            values = np.unwrap(values) if name == "heading" else values
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if self.command is None and self.steering is None:
            raise UnusableRun("neither command nor steering: what the driver did is not known")
        if self.heading is None and (self.x is not None or self.y is not None):
            raise UnusableRun("x and y need the heading, in the same axes: without it sideslip does not show in them")
        if count < FEWEST_SAMPLES or self.seconds < SHORTEST:
            raise UnusableRun(
                f"the run is too short: {self.seconds:g} s and {count} samples; "
                f"at least {SHORTEST:g} s and {FEWEST_SAMPLES} samples are needed"
            )
        slowest = int(np.argmin(self.speed))
        if self.speed[slowest] < SLOWEST:
            raise UnusableRun(
                f"speed falls to {self.speed[slowest]:.3g} m/s at {slowest * self.step:g} s; "
                f"the model with slip needs at least {SLOWEST:g} m/s"
            )

    @property
    def seconds(self) -> float:
        """Length of the run, s."""
        return (len(np.atleast_1d(self.speed)) - 1) * self.step

    @property
    def input(self) -> Floats:
        """The command, or where there is none the measured steering angle, rad."""
        driven = self.steering if self.command is None else self.command
        assert driven is not None  # checked when built
        return driven

    def save(self, path: str | Path) -> None:
        """Write a compressed .npz file; what was not measured is left out."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        np.savez_compressed(path, **{k: v for k, v in values.items() if v is not None})

    @classmethod
    def load(cls, path: str | Path) -> DrivenRun:
        """Read what `save` wrote, or any .npz file with these names; nothing in it is unpickled.

        Raises:
            UnusableRun: an entry is missing or unknown, or the run is unusable, or the file is none of that kind.
            OSError: it is missing or may not be read.
        """
        where = shown(str(path))
        try:
            values = read_arrays(path, LARGEST_FILE)
        except ValueError as error:
            raise UnusableRun(f"{where}: {error}") from None
        allowed = [field.name for field in fields(cls)]
        for name in ("step", *_REQUIRED):
            if name not in values:
                raise UnusableRun(f"{where} has no {name!r}; needed: step, {', '.join(_REQUIRED)}")
        for name, value in values.items():
            if name not in allowed:
                raise UnusableRun(f"{where} has an unknown entry {shown(name)}; allowed: {', '.join(allowed)}")
            if value.dtype.kind not in "iuf":
                raise UnusableRun(f"{where}: {name} has dtype {shown(str(value.dtype))}; allowed: numbers")
        try:
            plain: dict[str, Any] = {name: one.item() if one.ndim == 0 else one for name, one in values.items()}
            return cls(**plain)
        except ValueError as error:
            raise UnusableRun(f"{where}: {error}") from None
