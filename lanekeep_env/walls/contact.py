"""A car's body against walls: distance, contact, and contact anywhere between two poses.

The body is a rectangle, (half its length, half its width) in m, at a pose (x, y, cosine, sine): its centre in m and its
heading. Walls are x0, y0, x1, y1 in m, (4, n), of which those of a span (first, last) count, the last not among them.
All floats and arrays have one precision.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env.compile import helper, inline, kernel
from lanekeep_env.physics.numeric import clip, larger, like, smaller


@inline
def _apart(ax, ay, bx, by, half_length, half_width):
    """Whether the segment a-b and the rectangle around the origin are apart (separating axes; exact)."""
    ex, ey = bx - ax, by - ay
    # Twice the middle, against twice the reach: no halving.
    ahead = abs(ax + bx) > half_length + half_length + abs(ex)
    beside = abs(ay + by) > half_width + half_width + abs(ey)
    across = abs(ax * ey - ay * ex) > half_length * abs(ey) + half_width * abs(ex)
    return ahead | beside | across


@inline
def _outside(x, y, half_length, half_width):
    """Squared distance of a point from the rectangle around the origin."""
    dx = larger(abs(x) - half_length, like(x, 0.0))
    dy = larger(abs(y) - half_width, like(x, 0.0))
    return dx * dx + dy * dy


@inline
def _from_corner(x, y, ax, ay, ex, ey, inverse):
    """Squared distance of the point (x, y) from the segment that starts at a and runs along e."""
    px, py = x - ax, y - ay
    share = clip((px * ex + py * ey) * inverse, like(x, 0.0), like(x, 1.0))
    dx, dy = px - share * ex, py - share * ey
    return dx * dx + dy * dy


@helper
def touches(pose, body, walls, span):
    """Return whether a wall touches or enters the body."""
    (x, y, cosine, sine), (half_length, half_width), (first, last) = pose, body, span
    x0_, y0_, x1_, y1_ = walls[0, first:last], walls[1, first:last], walls[2, first:last], walls[3, first:last]
    count = 0
    for i in range(last - first):
        px, py, qx, qy = x0_[i] - x, y0_[i] - y, x1_[i] - x, y1_[i] - y
        ax, ay = cosine * px + sine * py, cosine * py - sine * px
        bx, by = cosine * qx + sine * qy, cosine * qy - sine * qx
        count += 0 if _apart(ax, ay, bx, by, half_length, half_width) else 1
    return count > 0


@helper
def clearance(pose, body, walls, span, scratch):
    """Return the distance of the body from the nearest wall, m; 0 in contact, inf without walls.

    ``scratch`` is (at least 1, at least last - first), overwritten.
    """
    (x, y, cosine, sine), (half_length, half_width), (first, last) = pose, body, span
    zero, one = like(x, 0.0), like(x, 1.0)
    x0_, y0_, x1_, y1_ = walls[0, first:last], walls[1, first:last], walls[2, first:last], walls[3, first:last]
    squared = scratch[0]
    for i in range(last - first):
        px, py, qx, qy = x0_[i] - x, y0_[i] - y, x1_[i] - x, y1_[i] - y
        ax, ay = cosine * px + sine * py, cosine * py - sine * px
        bx, by = cosine * qx + sine * qy, cosine * qy - sine * qx
        ex, ey = bx - ax, by - ay
        inverse = one / (ex * ex + ey * ey)
        ends = smaller(_outside(ax, ay, half_length, half_width), _outside(bx, by, half_length, half_width))
        left = smaller(
            _from_corner(half_length, half_width, ax, ay, ex, ey, inverse),
            _from_corner(-half_length, half_width, ax, ay, ex, ey, inverse),
        )
        right = smaller(
            _from_corner(half_length, -half_width, ax, ay, ex, ey, inverse),
            _from_corner(-half_length, -half_width, ax, ay, ex, ey, inverse),
        )
        apart = _apart(ax, ay, bx, by, half_length, half_width)
        squared[i] = smaller(ends, smaller(left, right)) if apart else zero
    nearest = like(x, np.inf)
    for i in range(last - first):
        nearest = smaller(squared[i], nearest)
    return np.sqrt(nearest)


@helper
def _exclude(axis, interval, origin, walls, span, apart):
    """Mark the walls beyond the interval along the axis from the origin."""
    (nx, ny), (low, high), (x, y), (first, last) = axis, interval, origin, span
    x0_, y0_, x1_, y1_ = walls[0, first:last], walls[1, first:last], walls[2, first:last], walls[3, first:last]
    one = like(x, 1.0)
    for i in range(last - first):
        a = nx * (x0_[i] - x) + ny * (y0_[i] - y)
        b = nx * (x1_[i] - x) + ny * (y1_[i] - y)
        apart[i] = one if (smaller(a, b) > high) | (larger(a, b) < low) else apart[i]


@helper
def sweeps(before, after, body, walls, span, scratch):
    """Return whether a wall may touch the body on its way from one pose to the next.

    The way is an arc at constant speed and yaw rate, of less than half a turn. Never False for a wall that is
    touched; True also for walls that miss the body by at most about turn·(path + turn·half diagonal)/8 (0.8 mm for
    0.2 m and 0.03 rad), the bulge of the corners' paths. ``scratch`` is as for `clearance`.
    """
    (x, y, cosine, sine), (x1, y1, cosine1, sine1), (half_length, half_width) = before, after, body
    first, last = span
    zero, one = like(x, 0.0), like(x, 1.0)
    dx, dy = x1 - x, y1 - y
    apart = scratch[0]
    for i in range(last - first):
        apart[i] = zero
    # A path keeps within (largest acceleration)·T²/8 of its chord. The angle from its chord: asin(c/2)/(c/2) < 1+c²/7.
    chord = (cosine1 - cosine) * (cosine1 - cosine) + (sine1 - sine) * (sine1 - sine)
    stretch = one + chord * like(x, 0.143)
    turn = np.sqrt(chord) * stretch
    path = np.sqrt(dx * dx + dy * dy) * stretch
    diagonal = np.sqrt(half_length * half_length + half_width * half_width)
    bulge = turn * (path + turn * diagonal) * like(x, 0.125)
    # Axes that may part a wall from the hull of both rectangles: their own normals, and those of the corners' chords.
    for axis in range(8):
        if axis < 4:
            c = cosine if axis < 2 else cosine1
            s = sine if axis < 2 else sine1
            nx = c if axis % 2 == 0 else -s
            ny = s if axis % 2 == 0 else c
        else:
            ahead = half_length if axis < 6 else -half_length
            left = half_width if axis % 2 == 0 else -half_width
            nx = -(dy + ahead * (sine1 - sine) + left * (cosine1 - cosine))
            ny = dx + ahead * (cosine1 - cosine) - left * (sine1 - sine)
        reach = half_length * abs(nx * cosine + ny * sine) + half_width * abs(ny * cosine - nx * sine)
        reach1 = half_length * abs(nx * cosine1 + ny * sine1) + half_width * abs(ny * cosine1 - nx * sine1)
        moved = nx * dx + ny * dy
        margin = bulge * np.sqrt(nx * nx + ny * ny)
        low, high = smaller(-reach, moved - reach1) - margin, larger(reach, moved + reach1) + margin
        _exclude((nx, ny), (low, high), (x, y), walls, span, apart)
    x0_, y0_, x1_, y1_ = walls[0, first:last], walls[1, first:last], walls[2, first:last], walls[3, first:last]
    count = 0
    for i in range(last - first):
        nx, ny = y0_[i] - y1_[i], x1_[i] - x0_[i]
        reach = half_length * abs(nx * cosine + ny * sine) + half_width * abs(ny * cosine - nx * sine)
        reach1 = half_length * abs(nx * cosine1 + ny * sine1) + half_width * abs(ny * cosine1 - nx * sine1)
        moved = nx * dx + ny * dy
        margin = bulge * (abs(nx) + abs(ny))
        at = nx * (x0_[i] - x) + ny * (y0_[i] - y)
        beyond = (at > larger(reach, moved + reach1) + margin) | (at < smaller(-reach, moved - reach1) - margin)
        count += 0 if beyond | (apart[i] > zero) else 1
    return count > 0


@kernel()
def measure_bodies(poses, half_length, half_width, walls, scratch, distance, contact):
    """Write `clearance` and `touches` of many poses (k, 3): x, y (m), heading (rad); both results are (k,)."""
    n = walls.shape[1]
    for i in range(poses.shape[0]):
        pose, body = (poses[i, 0], poses[i, 1], np.cos(poses[i, 2]), np.sin(poses[i, 2])), (half_length, half_width)
        distance[i] = clearance(pose, body, walls, (0, n), scratch)
        contact[i] = touches(pose, body, walls, (0, n))


@kernel()
def measure_sweeps(poses, half_length, half_width, walls, scratch, contact):
    """Write `sweeps` between each pose (k + 1, 3) and the next one; ``contact`` is (k,)."""
    n = walls.shape[1]
    for i in range(poses.shape[0] - 1):
        before = poses[i, 0], poses[i, 1], np.cos(poses[i, 2]), np.sin(poses[i, 2])
        after = poses[i + 1, 0], poses[i + 1, 1], np.cos(poses[i + 1, 2]), np.sin(poses[i + 1, 2])
        contact[i] = sweeps(before, after, (half_length, half_width), walls, (0, n), scratch)
