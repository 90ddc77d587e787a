"""How wide a corridor with a right angle must be for a car: forwards in one arc, and however often it shunts."""

from __future__ import annotations

import math


def swept_corner(length: float, width: float, wheelbase: float, angle: float) -> float:
    """Return the narrowest corridor, m, that a car drives round a right angle forwards, in one arc at ``angle``, rad.

    The arc's middle is on the corner's diagonal, its inner side touches the corner and the nose's outer corner both
    outer walls. Lengths are m; the body reaches as far beyond both axles.
    """
    radius, half, front = wheelbase / math.tan(angle), 0.5 * width, 0.5 * (wheelbase + length)
    return math.hypot(radius + half, front) - max(radius - half, 0.0) / math.sqrt(2.0)


def turned_corner(length: float, width: float) -> float:
    """Return the narrowest corridor, m, in which a rectangle goes round a right angle, turning on the spot.

    In as many short moves as that takes a car that drives backwards as well does so. At the angle a to a wall both ends
    of its outer side touch the outer walls; its inner side touches the corner where the corridor is
    (width + length sin(a) cos(a)) / (sin(a) + cos(a)) wide, which is most at 45 degrees or along a wall.
    """
    return max(width, (width + 0.5 * length) / math.sqrt(2.0))
