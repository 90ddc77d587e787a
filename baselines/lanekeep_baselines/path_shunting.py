"""Parking in several moves, in closed form: for gaps that one sweep backwards does not enter.

Planned from the parked car outwards: arc left until the nose's right corner comes to the box in front, arc right
backwards until the tail comes to the box behind or to the kerb, and so on, until the arc left passes the corner of the
box in front. Each move turns the car by the angle at which a corner of the body, on a circle of known radius, reaches a
line. The same backwards leads in: an arc left backwards on the circle of the last one, then the moves in reverse order.

Places count from the kerb at the front end of the box behind: ahead along the kerb and to the left, m. Everything is
elementwise over the rows; nothing is ever NaN.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_baselines.path_clearance import Body
from lanekeep_baselines.path_planning import PARKING_ANGLE, roll
from lanekeep_baselines.policy import Floats

#: Most moves within the gap, pairs of an arc left and one right; a pair that turns the car by less, rad, is none.
MOST, LEAST_TURN = 12, 0.01


class Shunts(NamedTuple):
    """Moves out of a gap, (n,) each but the segments.

    Attributes:
        segments: (n, 2 `MOST`, 2), way, m, and curvature, 1/m, of each move; 0 where there is none.
        moves: how many there are: an even number, after which an arc left forwards leaves the gap.
        place, line: of the rear axle, m, where the circle of that arc is parallel to the kerb.
        heading: with which it begins, rad.
        ok: whether the car gets out.
    """

    segments: Floats
    moves: NDArray[np.intp]
    place: Floats
    line: Floats
    heading: Floats
    ok: NDArray[np.bool_]


def shunts(gap: ArrayLike, depth: ArrayLike, kerb: ArrayLike, body: Body, air: float, kerb_air: float) -> Shunts:
    """Return the moves out of a gap, from the place as near as ``air`` to the box behind, along the kerb.

    Args:
        gap: its length, m, (n,).
        depth: how far the box in front reaches from the kerb, m, (n,).
        kerb: distance of the parked body from it, m, (n,).
        body: of the car.
        air, kerb_air: kept to boxes and to the kerb, m.
    """
    gap, depth, kerb = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in (gap, depth, kerb))
    )
    blank = np.zeros(len(gap))
    pose = np.stack([blank + air + body.rear, kerb + body.half_width, blank], axis=1)
    segments, moves = np.zeros((len(gap), 2 * MOST, 2)), np.zeros(len(gap), dtype=np.intp)
    stuck = gap < body.rear + body.front + 2.0 * air
    for move in range(MOST):
        goes = ~passes(pose, gap - air, depth + air, body) & ~stuck
        if not goes.any():
            break
        forwards = body.radius_left * (reach_ahead(pose, gap - air, body) - pose[:, 2])
        there = roll(pose, forwards, 1.0 / body.radius_left)
        turn = reach_behind(there, air, kerb_air, body) - there[:, 2]
        stuck |= goes & (there[:, 2] - pose[:, 2] + np.maximum(turn, 0.0) < LEAST_TURN)
        goes &= ~stuck & (turn >= 0.0)
        stuck |= turn < 0.0
        segments[:, 2 * move, 0] = np.where(goes, forwards, 0.0)
        segments[:, 2 * move + 1, 0] = np.where(goes, -body.radius_right * turn, 0.0)
        segments[:, 2 * move, 1] = np.where(goes, 1.0 / body.radius_left, 0.0)
        segments[:, 2 * move + 1, 1] = np.where(goes, -1.0 / body.radius_right, 0.0)
        pose = np.where(goes[:, None], roll(there, segments[:, 2 * move + 1, 0], -1.0 / body.radius_right), pose)
        moves += 2 * goes
    x, y, heading = pose.T
    line = y - body.radius_left * (1.0 - np.cos(heading))
    ok = ~stuck & passes(pose, gap - air, depth + air, body) & (heading <= PARKING_ANGLE)
    return Shunts(segments, moves, x - body.radius_left * np.sin(heading), line, heading, ok)


def passes(pose: Floats, ahead: Floats, left: Floats, body: Body) -> NDArray[np.bool_]:
    """Return where the nose's right corner, on an arc left from a pose (n, 3), passes the corner (ahead, left)."""
    x, y, heading = pose.T
    dx = ahead - (x - body.radius_left * np.sin(heading))
    dy = left - (y + body.radius_left * np.cos(heading))
    return (dx**2 + dy**2 >= (body.radius_left + body.half_width) ** 2 + body.front**2) & (dy < 0.0)


def reach_ahead(pose: Floats, line: Floats, body: Body) -> Floats:
    """Return the heading, (n,), at which an arc left brings the nose's right corner ``line`` m ahead.

    The present one where it is there already.
    """
    x, _, heading = pose.T
    return np.maximum(
        _angle(line - x + body.radius_left * np.sin(heading), body.radius_left + body.half_width, body.front), heading
    )


def reach_behind(pose: Floats, line: ArrayLike, kerb: ArrayLike, body: Body) -> Floats:
    """Return the heading, (n,), at which an arc right backwards brings the tail to a ``line``, or near to the kerb.

    Less than the present where it is there already.
    """
    x, y, heading = pose.T
    radius = body.radius_right
    by_box = _angle(x + radius * np.sin(heading) - line, radius + body.half_width, body.rear)
    inner = radius - body.half_width
    share = (kerb - y + radius * np.cos(heading)) / np.hypot(inner, body.rear)
    by_kerb = np.arccos(np.clip(share, -1.0, 1.0)) - np.arctan2(body.rear, inner)
    return np.minimum(by_box, by_kerb)


def _angle(way: Floats, across: float | Floats, along: float) -> Floats:
    """Return the angle a with across sin(a) + along cos(a) = way, a right one at most."""
    return np.arcsin(np.clip(way / np.hypot(across, along), -1.0, 1.0)) - np.arctan2(along, across)
