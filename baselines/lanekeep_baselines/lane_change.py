"""Changing lanes: along which path, and whether there is room; as pure functions over rows.

The path is the quintic of the evasive manoeuvre (Werling, Gröll, Bretthauer 2008, Figure 8; `EvasiveRoads`):
y = D (10 u³ - 15 u⁴ + 6 u⁵), u the share of its way that is driven. Its lateral acceleration is 5.8 D / T² at the most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats


class PathPoint(NamedTuple):
    """What a path asks for: lateral position, m, its slope, and its curvature from the road's, 1/m."""

    lateral: Floats
    slope: Floats
    curvature: Floats


def quintic_at(share: Floats, shift: Floats, length: Floats) -> PathPoint:
    """Return the path at a share of its way, held at 0 before and 1 behind it, (n,) each.

    Args:
        share: u.
        shift: D, m, to the left.
        length: of the way, m.
    """
    u = np.clip(share, 0.0, 1.0)
    lateral = shift * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    slope = shift / length * 30.0 * (u * (1.0 - u)) ** 2
    bend = shift / length**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    return PathPoint(lateral, slope, bend / (1.0 + slope * slope) ** 1.5)


class Room(NamedTuple):
    """What a change of lanes takes.

    Attributes:
        gap: left between two bodies at the least, m.
        time: gap to the car ahead, and of the car behind to this one, as time at the speed of the one behind, s.
        braking: with which the one behind may adjust its speed, m/s².
    """

    gap: float = 5.0
    time: float = 0.6
    braking: float = 2.0

    def enough(self, gap: Floats, rear: Floats, front: Floats) -> NDArray[np.bool_]:
        """Return whether a gap (m) is enough between cars at the speeds ``rear`` and ``front``, m/s, (n,)."""
        closing = np.maximum(rear - front, 0.0)
        return gap > self.gap + self.time * rear + closing * closing / (2.0 * self.braking)


def passing_speed(wish: Floats, gap: Floats, ahead: Floats, horizon: float) -> Floats:
    """Return the speed that a lane lets a car have on average over a horizon (s) behind the car ahead, m/s, (n,).

    At its wish until it has caught up with the car, then at that one's.
    """
    closing = np.maximum(wish - ahead, 1e-6)
    free = np.clip(gap / (closing * horizon), 0.0, 1.0)
    return np.where(ahead < wish, ahead + (wish - ahead) * free, wish)
