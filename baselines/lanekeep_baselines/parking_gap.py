"""Where a car in a gap is, by what it hears there: the kerb to its right and the box ahead of it.

Both correct what odometry says by a share of what a reading is off the expected one; readings far off are of something
else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.parking_row import IN, LEFT, Search
from lanekeep_baselines.policy import Floats
from lanekeep_env.sensing.ultrasonic import HALF_CONE

#: Kerb and box are heard if they are nearer, m; a reading this far off is of something else, m.
DEEP, AHEAD, OTHER = 0.35, 0.45, 0.06
#: How far the nose's sensor is below a box's corner to face it, m.
CORNER = 0.03
#: Share by which place and distance follow.
FOLLOWS = 0.15


def hear(right: Floats, front: Floats, heading: Floats, now: Search, side: float, nose: float) -> Search:
    """Return the search with place and kerb corrected by the ultrasonics, in rows that are in a gap.

    Args:
        right, front: readings, m, (n,).
        heading: from the kerb's direction, rad, (n,).
        now: the search.
        side, nose: from the rear axle to the sensors, m.
    """
    inside = (now.phase >= LEFT) & (now.phase <= IN)
    beyond = np.maximum(np.abs(heading) - HALF_CONE, 0.0)
    seen = (now.kerb + side * np.sin(heading)) / np.cos(beyond)
    off = np.where(inside & (seen < DEEP) & _same(right, seen), right - seen, 0.0)
    kerb = now.kerb + FOLLOWS * off
    # The rear of the box ahead: straight ahead of the nose's sensor, well below the box's corner, and within its cone.
    ahead = now.begin - now.place - nose * np.cos(heading)
    faces = (now.kerb + nose * np.sin(heading) < now.depth - CORNER) & (np.abs(heading) < HALF_CONE)
    off = np.where(inside & faces & (ahead < AHEAD) & _same(front, ahead), front - ahead, 0.0)
    return now._replace(kerb=kerb, place=now.place - FOLLOWS * off)


def _same(reading: Floats, expected: Floats) -> NDArray[np.bool_]:
    """Return where a reading is of what is expected there."""
    return np.abs(reading - expected) < OTHER
