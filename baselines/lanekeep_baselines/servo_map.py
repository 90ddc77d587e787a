"""The map from commands to angles of the road wheel, identified from half circles and inverted (KnightRiders, 6.2).

The report's car has a servo in ticks whose turning circles differ to the left and right; half circles were driven every
five ticks to measure it, and the map was never inverted. A map is points (command, angle), rad, + left, and linear
between them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lanekeep_baselines.policy import Floats
from lanekeep_env.scenario import Servo


class ServoMap:
    """What a servo makes of commands, and the commands that angles ask for.

    Args:
        commands: rising, rad, (k,).
        angles: rising, rad, (k,).

    Raises:
        ValueError: angles that do not rise: such a servo cannot be inverted.
    """

    def __init__(self, commands: ArrayLike, angles: ArrayLike) -> None:
        self._commands, self._angles = np.asarray(commands, dtype=np.float64), np.asarray(angles, dtype=np.float64)
        if not (np.diff(self._commands) > 0.0).all() or not (np.diff(self._angles) > 0.0).all():
            raise ValueError("commands and angles of a servo must rise from right to left")

    @classmethod
    def of(cls, servo: Servo, limit: float) -> ServoMap:
        """Return the map of a servo that is known, for commands up to ``limit``, rad; ticks are not undone."""
        table = servo.table(limit)
        angles = np.array([-limit, limit]) if table is None else table[1:]
        return cls(np.linspace(-limit, limit, len(angles)), angles)

    @classmethod
    def from_half_circles(cls, commands: ArrayLike, ways: ArrayLike, wheelbase: float) -> ServoMap:
        """Return the map that half circles show.

        Args:
            commands: rising, rad, (k,).
            ways: of the rear axle along half a circle at each, m, (k,): negative to the right, infinite straight on.
            wheelbase: m.
        """
        return cls(commands, np.arctan(np.pi * wheelbase / np.asarray(ways, dtype=np.float64)))

    @property
    def right(self) -> float:
        """Largest angle to the right, rad, positive."""
        return float(-self._angles[0])

    @property
    def left(self) -> float:
        """Largest angle to the left, rad."""
        return float(self._angles[-1])

    def angle(self, command: Floats) -> Floats:
        """Return the angle of the road wheel at a command."""
        return np.interp(command, self._commands, self._angles)

    def command(self, angle: Floats) -> Floats:
        """Return the command for an angle, the last one for angles beyond the map."""
        return np.interp(angle, self._angles, self._commands)
