"""White noise of the sensors in a recorded run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lanekeep_baselines.identification.run import DrivenRun
from lanekeep_env.checks import require


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of white noise in a recorded run; the defaults are good serial sensors and differential GPS.

    Attributes:
        speed: m/s.
        steering: of the angle as it is logged (steering wheel, where the car has a ratio), rad.
        yaw_rate: rad/s.
        heading: rad.
        position: in x and in y, m.
    """

    speed: float = 0.02
    steering: float = 2e-3
    yaw_rate: float = 5e-3
    heading: float = 3e-3
    position: float = 0.03

    def __post_init__(self) -> None:
        for name, unit in (("speed", "m/s"), ("steering", "rad"), ("yaw_rate", "rad/s"), ("heading", "rad")):
            require(f"noise.{name}", getattr(self, name), unit, at_least=0.0)
        require("noise.position", self.position, "m", at_least=0.0)

    def added_to(self, run: DrivenRun, seed: int) -> DrivenRun:
        """Return the run with noise of ``seed`` in everything measured; the command is known, not measured."""
        random = np.random.default_rng(seed)
        deviations = {
            "speed": self.speed,
            "steering": self.steering,
            "yaw_rate": self.yaw_rate,
            "heading": self.heading,
            "x": self.position,
            "y": self.position,
        }
        noisy = {}
        for name, deviation in deviations.items():
            noise = deviation * random.standard_normal(len(run.speed))
            if getattr(run, name) is not None:
                noisy[name] = getattr(run, name) + noise
        return replace(run, **noisy)
