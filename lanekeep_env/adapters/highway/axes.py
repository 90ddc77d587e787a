"""highway-env's y axis points to the right of its x axis: the one place where its signs become those of ISO 8855.

Mirroring negates y and every angle, and taking it twice changes nothing: one function serves both ways, exactly.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def mirrored(place: Any) -> Floats:
    """Return a position or a velocity (2,) of the other's axes in one's own."""
    x, y = place
    return np.array([x, -y], dtype=np.float64)


def turned(angle: float) -> float:
    """Return what counts to the other side: a heading, a yaw rate, a steering angle, a lateral coordinate."""
    return -angle
