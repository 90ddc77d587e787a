"""An ultrasonic sensor: the nearest wall inside a cone, whatever its angle."""

from __future__ import annotations

import math

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import clip, larger, like, smaller

#: The 1:10 car's (Team KnightRiders 2017): range, m, and half the angle of the cone, rad.
NEAREST, FARTHEST, HALF_CONE = 0.03, 6.0, math.radians(22.5)
#: Of half the angle, written down: not every machine's tan ends in the same digit.
TANGENT = 0.41421356237309503
#: Its sensors by name: row of the distance, row of the settings that says how far ahead it sits, and the cosine and
#: sine of its angle to the car's axis.
ULTRASONICS = {
    "right": (at.RIGHT, at.SIDE_ARM, 0.0, -1.0),
    "left": (at.LEFT, at.SIDE_ARM, 0.0, 1.0),
    "front": (at.FRONT, at.FRONT_ARM, 1.0, 0.0),
}


@helper
def cone_distance(pose, cone, walls, span, scratch):
    """Return the distance of the nearest point of a wall inside the cone, m, or NaN where there is none in range.

    Args:
        pose: (x, y, cosine, sine): the sensor's place, m, and the direction of the cone's axis.
        cone: (tangent, nearest, farthest): of half the cone's angle, which is less than a right one, and range, m.
        walls: (4, n), m, of which those of ``span`` (first, last) count, the last not among them.
        scratch: (at least 1, at least last - first), overwritten.
    """
    (x, y, cosine, sine), (tangent, nearest, farthest), (first, last) = pose, cone, span
    zero, one, far = like(x, 0.0), like(x, 1.0), like(x, np.inf)
    x0_, y0_, x1_, y1_ = walls[0, first:last], walls[1, first:last], walls[2, first:last], walls[3, first:last]
    squared = scratch[0]
    for i in range(last - first):
        px, py, qx, qy = x0_[i] - x, y0_[i] - y, x1_[i] - x, y1_[i] - y
        ax, ay = cosine * px + sine * py, cosine * py - sine * px
        bx, by = cosine * qx + sine * qy, cosine * qy - sine * qx
        # The share of the wall inside both half-planes that bound the cone.
        a0, a1 = tangent * ax - ay, tangent * bx - by
        b0, b1 = tangent * ax + ay, tangent * bx + by
        cut_a = a0 / (a0 - a1 if a0 != a1 else one)
        cut_b = b0 / (b0 - b1 if b0 != b1 else one)
        low = larger(cut_a if a0 < zero else zero, cut_b if b0 < zero else zero)
        high = smaller(cut_a if a1 < zero else one, cut_b if b1 < zero else one)
        none = ((a0 < zero) & (a1 < zero)) | ((b0 < zero) & (b1 < zero)) | (low > high)
        ex, ey = bx - ax, by - ay
        share = clip(-(ax * ex + ay * ey) / (ex * ex + ey * ey), low, high)
        dx, dy = ax + share * ex, ay + share * ey
        squared[i] = far if none else dx * dx + dy * dy
    least = far
    for i in range(last - first):
        least = smaller(squared[i], least)
    distance = np.sqrt(least)
    return distance if (distance >= nearest) & (distance <= farthest) else like(x, np.nan)
