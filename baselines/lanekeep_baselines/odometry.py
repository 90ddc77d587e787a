"""How fast and how far a car between walls has driven: from its encoder and what its motor was told.

An encoder counts whole ticks, so it tells the mean speed of a step, coarsely, where the present one is wanted: a tick
in 45 ms is 0.12 m/s. But the motor goes to the set speed at a known rate, which the ticks only have to correct.

Everything is elementwise over the rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import DrivingScenario, Floats
from lanekeep_env.sensing.faults import Sensor, Sensors


class OdometryScenario(DrivingScenario, Protocol):
    """What odometry may know besides."""

    @property
    def sensors(self) -> Sensors: ...
    @property
    def max_acceleration(self) -> float: ...
    @property
    def encoder_ticks(self) -> int: ...
    @property
    def encoder_direction(self) -> bool: ...


def ramp(before: Floats, target: Floats, most: float) -> tuple[Floats, Floats]:
    """Return what goes to a target evenly, by at most ``most`` a step, at the step's end, and its mean."""
    change = np.clip(target - before, -most, most)
    return before + change, before + change * (1.0 - 0.5 * np.abs(change) / most)


class Odometer:
    """Reads the encoder; its memory is the speed at the last step's end."""

    memory: ClassVar[int] = 1
    reads: ClassVar[tuple[str, ...]] = ("speed", "speed_command")

    #: Share of a coarse or noisy encoder's difference that corrects the speed.
    GAIN: ClassVar[float] = 0.2

    def __init__(self, scenario: OdometryScenario) -> None:
        self._step, self._faster = scenario.control_step, scenario.max_acceleration * scenario.control_step
        self._ticks, self._signed = scenario.encoder_ticks > 0, scenario.encoder_direction
        exact = not self._ticks and dict(scenario.sensors).get("speed", Sensor()) == Sensor()
        self._gain = 1.0 if exact else self.GAIN

    def update(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats, Floats]:
        """Return present speed and mean speed in the step that ended, m/s, (n,), and the next memory, (n, 1)."""
        before = np.where(fresh, at["speed"], memory[:, 0])
        speed, mean = ramp(before, at["speed_command"], self._faster)
        read = at["speed"] if self._signed else np.copysign(at["speed"], mean)
        error = np.where(fresh, 0.0, self._gain * (read - (mean if self._ticks else speed)))
        return speed + error, mean + error, (speed + error)[:, None]
