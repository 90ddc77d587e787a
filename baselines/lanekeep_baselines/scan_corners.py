"""The report's corner rule: a straight wall at the right rim of the scan that ends (KnightRiders, 4.3.3).

From the rightmost beam to the middle: a wall near enough, 0.75 to 2 m long and nearly along the car, then a jump, and
0.5 m of free space behind it. Right corners only. `scan_features` judges each beam by itself instead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_classes import Perception
from lanekeep_baselines.scan_targets import free_beside, jumps
from lanekeep_env.scenario import Scan

#: Length of the wall, m (the report's).
SHORTEST, LONGEST = 0.75, 2.0
#: Decisions: how far to the right the wall is at most, m; its slope against the car, and what its points may be off, m.
BESIDE, SLOPE, SPREAD = 1.5, float(np.tan(np.deg2rad(15.0))), 0.05


class Corner(NamedTuple):
    """The end of the right wall, (n,) each: ahead of and to the left of the nose, m, 0 where none is found."""

    ahead: Floats
    left: Floats
    found: NDArray[np.bool_]


def right_corner(place: Floats, camera: Scan, rule: Perception) -> Corner:
    """Return the corner in the points (n, beams, 2) of a camera's scan."""
    half = place[:, : (place.shape[1] + 1) // 2]
    ahead, across = half[..., 0] - half[:, :1, 0], half[..., 1] - half[:, :1, 1]
    length = np.hypot(ahead, across)
    beams = np.arange(half.shape[1])
    end = np.where(jumps(half, camera, rule)[0], beams, len(beams)).min(axis=1)
    last = np.minimum(end, len(beams) - 1)
    on_wall = np.abs(across) <= SLOPE * np.maximum(ahead, 0.0) + SPREAD
    straight = np.all(on_wall | (beams > last[:, None]), axis=1)
    reached = np.take_along_axis(length, last[:, None], axis=1)[:, 0]
    found = (end < len(beams)) & (-half[:, 0, 1] <= BESIDE) & straight
    found &= (reached >= SHORTEST) & (reached <= LONGEST)
    found &= free_beside(place, last, 1.0, rule)
    end_place = np.take_along_axis(half, last[:, None, None], axis=1)[:, 0]
    to_end, to_left = np.where(found, end_place.T, 0.0)
    return Corner(to_end, to_left, found)
