"""What an identification tells: values, errors, intervals, residuals; and the design model that they make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.yin_design import FASTEST_LAG, STEERING_RATIO, YinModel

#: What is identified, in this order everywhere.
PARAMETERS = ("a11", "a12", "a21", "a22", "b1", "b2", "lag")
UNITS = ("m/s²", "m²/s²", "1/s²", "m/s²", "m/s²", "1/s²", "s")


@dataclass(frozen=True)
class Identification:
    """What a run tells about a car.

    Attributes:
        values: a11 (m/s²), a12 (m²/s²), a21 (1/s²), a22 (m/s²), b1 (m/s²) and b2 (1/s²) per rad of the logged steering
            angle, lag (s).
        standard_errors: of each, same units; 0 for a lag that was given.
        covariance: of the values, in their order, (7, 7).
        degrees_of_freedom: measured numbers less fitted ones.
        residual_rms: by measurement, SI; with a good model the noise of the sensors.
        residual_correlation: of neighbouring residuals, by measurement. Far from 0 (say 0.2) means that the model or
            that sensor has a fault which is not white noise; intervals are then too narrow.
        evaluations: simulations of the run.
        steering_ratio: of the logged steering angle over the road wheel's.
    """

    values: Mapping[str, float]
    standard_errors: Mapping[str, float]
    covariance: tuple[tuple[float, ...], ...]
    degrees_of_freedom: int
    residual_rms: Mapping[str, float]
    residual_correlation: Mapping[str, float]
    evaluations: int
    steering_ratio: float

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % interval of each value (Student's t)."""
        half = float(stdtrit(self.degrees_of_freedom, 0.975))
        errors = self.standard_errors
        return {name: (value - half * errors[name], value + half * errors[name]) for name, value in self.values.items()}

    def model(self) -> YinModel:
        """Return the identified model with b1 and b2 for a steering wheel geared as Yin's design has it, 16:1.

        A lag below 20 ms is taken as 20 ms, as the design does.
        """
        gear, v = self.steering_ratio / STEERING_RATIO, self.values
        rate = 1.0 / max(v["lag"], FASTEST_LAG)
        return YinModel(v["a11"], v["a12"], v["a21"], v["a22"], gear * v["b1"], gear * v["b2"], rate)

    def covariance_matrix(self) -> Floats:
        """Return the covariance of the values, (7, 7)."""
        return np.array(self.covariance)

    def __str__(self) -> str:
        lines = []
        for name, unit in zip(PARAMETERS, UNITS, strict=True):
            low, high = self.intervals[name]
            lines.append(f"{name:4} {self.values[name]:10.4g} {unit:6} [{low:.4g}, {high:.4g}]")
        return "\n".join(lines)
