"""A driver's record: how one looks ahead, corrects, wanders and looks away."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_env.checks import ordered, plain_numbers, record_from, require

#: Places of a driver's numbers: s ahead at which the road's curvature is steered for; steering against the lateral
#: error, 1/s², and the course error, 1/s; share of the remaining way that the hands go in a control step; standard
#: deviation of where the driver wants to be, m, and what a control step leaves of that;
PREVIEW, LATERAL, COURSE, SHARE, WANDER, KEEPS = 0, 1, 2, 3, 4, 5
#: probability a control step that the driver looks away, and for how many of them; steering angle over curvature, m,
#: and its growth with the speed's square, s²/m.
LAPSES, SHORTEST, LONGEST, ANGLE, ANGLE_GROWTH = 6, 7, 8, 9, 10


@dataclass(frozen=True)
class Driver:
    """Donges's two-level driver (1978) with wandering and lapses; see `tasks.driver`.

    Attributes:
        preview_time: how far ahead the road's curvature is steered for, s.
        frequency, damping: of the correction of lateral errors, rad/s and 1.
        lag: of the hands, s.
        wander: standard deviation of where the driver wants to be in the lane, m.
        wander_time: in which that changes, s.
        lapse_rate: how often the driver looks away, a second of looking, 1/s.
        shortest_lapse, longest_lapse: for how long, s; uniform between them. The wheel is held meanwhile.
    """

    preview_time: float = 0.4
    frequency: float = 0.8
    damping: float = 0.9
    lag: float = 0.2
    wander: float = 0.1
    wander_time: float = 5.0
    lapse_rate: float = 0.0
    shortest_lapse: float = 1.0
    longest_lapse: float = 4.0

    def __post_init__(self) -> None:
        require("driver.preview_time", self.preview_time, "s", at_least=0.0, at_most=10.0)
        require("driver.frequency", self.frequency, "rad/s", at_least=0.0, at_most=10.0)
        require("driver.damping", self.damping, "", at_least=0.0, at_most=10.0)
        require("driver.lag", self.lag, "s", at_least=0.0, at_most=5.0)
        require("driver.wander", self.wander, "m", at_least=0.0, at_most=10.0)
        require("driver.wander_time", self.wander_time, "s", above=0.0, at_most=1e4)
        require("driver.lapse_rate", self.lapse_rate, "1/s", at_least=0.0, at_most=10.0)
        require("driver.shortest_lapse", self.shortest_lapse, "s", at_least=0.0, at_most=1e3)
        require("driver.longest_lapse", self.longest_lapse, "s", at_least=0.0, at_most=1e3)
        ordered(self, "driver", "shortest_lapse", "longest_lapse")
        plain_numbers(self)

    @property
    def lapses(self) -> bool:
        """Whether the driver ever looks away."""
        return self.lapse_rate > 0.0

    @property
    def wanders(self) -> bool:
        """Whether the driver wants to be anywhere but in the middle."""
        return self.wander > 0.0

    def numbers(self, step: float, steering: tuple[float, float]) -> np.ndarray:
        """Numbers for the kernel, (11,).

        Args:
            step: the control step, s.
            steering: angle over curvature of the car, m, and its growth with the speed's square, s²/m.
        """
        values = np.zeros(ANGLE_GROWTH + 1)
        values[PREVIEW] = self.preview_time
        values[LATERAL] = self.frequency**2
        values[COURSE] = 2.0 * self.damping * self.frequency
        values[SHARE] = 1.0 - np.exp(-step / self.lag) if self.lag > 0.0 else 1.0
        values[WANDER], values[KEEPS] = self.wander, np.exp(-step / self.wander_time)
        values[LAPSES] = 1.0 - np.exp(-self.lapse_rate * step)
        values[SHORTEST], values[LONGEST] = self.shortest_lapse / step, self.longest_lapse / step
        values[ANGLE : ANGLE + 2] = steering
        return values


#: By name. The drowsy one looks away every 25 seconds and wanders twice as far.
DRIVERS: dict[str, Driver] = {
    "attentive": Driver(),
    "drowsy": Driver(wander=0.2, lapse_rate=0.04),
}


def driver_from(value: str | Mapping[str, Any] | Driver) -> Driver:
    """Read a driver: a name of `DRIVERS`, a mapping of fields (of changes to its ``base``), or a record."""
    return record_from(Driver, value, "driver", DRIVERS)
