"""Exact ranges of a fan of beams to wall segments, fast enough to scan at every step.

A beam leaves the sensor in the direction d. A wall from a to b (relative to the sensor, b to the left of a,
k = a x b > 0) is hit where a x d >= 0 and b x d <= 0, and the inverse of the range is (a x d - b x d) / k: no
division for a beam. Each wall is tried only on the beams that its two bearings enclose, a run of
neighbours in the table, taken in whole blocks. Two walls that share a corner compute the same sign
there, so no beam slips between them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import DTypeLike, NDArray

from lanekeep_env.compile import helper, inline, kernel
from lanekeep_env.physics.numeric import arctan, like

#: Rows of the scratch array: both ends seen from the sensor, inverse of their cross product, enclosed beams.
AX, AY, BX, BY, INVERSE, FIRST, LAST = range(7)
SCRATCH_ROWS = 7

#: Beams of a block; tables are padded to whole blocks.
BLOCK = 16

# A wall is edge-on when its line passes the sensor closer than this many roundings of the coordinates.
_EDGE_ON = 64.0


def beam_table(count: int, step: float, dtype: DTypeLike = np.float64) -> NDArray:
    """Cosine and sine of ``count`` beams, ``step`` rad apart (to the left), from the first one.

    Returns:
        (2, m), where m is ``count`` rounded up to whole blocks; the beams beyond ``count`` are copies of the last.

    Raises:
        ValueError: no beam, or a fan of a full turn or more.
    """
    if not (count >= 1 and step > 0.0 and (count - 1) * step < 2.0 * math.pi):
        raise ValueError(
            f"{count} beams {step} rad apart are not allowed: at least 1 beam, a step > 0 rad, "
            "and less than a full turn from the first to the last"
        )
    angles = step * np.minimum(np.arange(-(-count // BLOCK) * BLOCK), count - 1)
    return np.array([np.cos(angles), np.sin(angles)], dtype=dtype)


@inline
def bearing(x, y):
    """Return the angle of (x, y) from the x axis, rad, in [0, 2 pi]."""
    zero = like(x, 0.0)
    along, across = abs(x), abs(y)
    steep = across > along
    large = across if steep else along
    small = along if steep else across
    angle = arctan(small / (large if large > zero else like(x, 1.0)))
    angle = like(x, 1.5707963267948966) - angle if steep else angle
    angle = like(x, 3.141592653589793) - angle if x < zero else angle
    return like(x, 6.283185307179586) - angle if y < zero else angle


@helper
def _face(pose, step, count, walls, span, scratch):
    """Fill ``scratch`` with the walls of a span as the sensor sees them."""
    (x, y, cosine, sine), (first, last) = pose, span
    zero, one, turn = like(x, 0.0), like(x, 1.0), like(x, 6.283185307179586)
    rounding = like(x, _EDGE_ON) * like(x, np.finfo(walls.dtype).eps)
    beams = one / step
    nothing = count + one
    x0_, y0_, x1_, y1_ = walls[0, first:last], walls[1, first:last], walls[2, first:last], walls[3, first:last]
    ax_, ay_, bx_, by_ = scratch[AX], scratch[AY], scratch[BX], scratch[BY]
    inverse_, first_, last_ = scratch[INVERSE], scratch[FIRST], scratch[LAST]
    for i in range(last - first):
        px, py, qx, qy = x0_[i] - x, y0_[i] - y, x1_[i] - x, y1_[i] - y
        ax, ay = cosine * px + sine * py, cosine * py - sine * px
        bx, by = cosine * qx + sine * qy, cosine * qy - sine * qx
        cross = ax * by - ay * bx
        size = abs(cross)
        distance, length = abs(ax) + abs(ay) + abs(bx) + abs(by), abs(bx - ax) + abs(by - ay)
        # False for an edge-on wall and for a pose that is not finite: no beam is tried then.
        faces = size > rounding * distance * length
        swap = cross < zero
        ax_[i] = bx if swap else ax
        ay_[i] = by if swap else ay
        bx_[i] = ax if swap else bx
        by_[i] = ay if swap else by
        inverse_[i] = one / size
        a, b = bearing(ax, ay), bearing(bx, by)
        start = b if swap else a
        end = a if swap else b
        end = end if end >= start else end + turn
        first_[i] = start * beams if faces else nothing
        last_[i] = end * beams if faces else -nothing


@helper
def _try(wall, begin, end, beams, scratch, fan):
    """Keep the larger inverse range of one wall and the beams of the blocks that hold begin..end-1."""
    ax, ay, bx, by = scratch[AX, wall], scratch[AY, wall], scratch[BX, wall], scratch[BY, wall]
    inverse = scratch[INVERSE, wall]
    zero = like(ax, 0.0)
    for block in range(begin // BLOCK * BLOCK, end, BLOCK):
        cosine_, sine_ = beams[0, block : block + BLOCK], beams[1, block : block + BLOCK]
        fan_ = fan[block : block + BLOCK]
        for i in range(BLOCK):
            after = ax * sine_[i] - ay * cosine_[i]
            before = bx * sine_[i] - by * cosine_[i]
            value = (after - before) * inverse
            hit = (after >= zero) & (before <= zero) & (value > fan_[i])
            fan_[i] = value if hit else fan_[i]


@helper
def cast(pose, optics, walls, span, scratch, fan, ranges):
    """Write the range of each beam, m.

    Args:
        pose: (x, y, cosine, sine): the sensor's place, m, and the direction of the FIRST beam; the others follow to
            the left.
        optics: (step, reach, beams): angle between beams, rad, range that is told where no wall is nearer (m, may be
            inf), and `beam_table` of that step, (2, m).
        walls: x0, y0, x1, y1 in m, (4, n); those of ``span`` (first, last) are seen, the last not among them.
        scratch: (7, at least last - first), overwritten.
        fan: (m,), overwritten.
        ranges: (count,), the result.

    A wall has no thickness: one whose line runs through the sensor to rounding is not seen. All floats
    and arrays have one precision. A pose that is not finite sees nothing.
    """
    (step, reach, beams), (first, last), count = optics, span, ranges.shape[0]
    zero, one = like(step, 0.0), like(step, 1.0)
    for i in range(beams.shape[1]):
        fan[i] = zero
    _face(pose, step, like(step, count), walls, span, scratch)
    turn = like(step, 6.283185307179586) / step
    for wall in range(last - first):
        # One beam more at the end: the bearings are rounded, the signs of the cross products decide.
        end = scratch[LAST, wall]
        begin = np.int64(scratch[FIRST, wall])
        if begin < count:
            _try(wall, begin, min(np.int64(end) + 2, count), beams, scratch, fan)
        again = np.int64(end - turn) + 2
        if again > 0:
            _try(wall, 0, min(again, count), beams, scratch, fan)
    for i in range(count):
        reading = one / fan[i]
        ranges[i] = reading if reading < reach else reach


@kernel()
def cast_many(poses, first_angle, optics, walls, scratch, fan, ranges):
    """Scan from many poses (k, 3): x, y (m), heading (rad); ``first_angle`` is that of beam 0 to the heading.

    ``ranges`` is (k, count); the rest is as for `cast`. For tests and tools; environments call `cast`.
    """
    for i in range(poses.shape[0]):
        angle = poses[i, 2] + first_angle
        pose = poses[i, 0], poses[i, 1], np.cos(angle), np.sin(angle)
        cast(pose, optics, walls, (0, walls.shape[1]), scratch, fan, ranges[i])
