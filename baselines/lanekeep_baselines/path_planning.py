"""Paths of arcs and straights in closed form: evading an obstacle and parallel parking (KnightRiders, 4.3.1 and 5).

A path is a row of segments, (n, k, 2): the signed way of the rear axle's middle (m, negative backwards) and the signed
curvature (1/m, + left). Ways, places and turning radii are the REAR AXLE's; the radii to the left and to the right
differ. Places count in the car's frame: ahead and to the left, m. Everything is elementwise over the rows; nothing is
ever NaN: where there is no path, ``ok`` is False and all segments are 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_baselines.policy import Floats

#: Decision: a path that turns farther than this before its straight evades nothing, rad.
STEEPEST = 0.5 * np.pi
#: Angle of the arcs of the report's parking, rad.
PARKING_ANGLE = 0.25 * np.pi
#: Numbers beyond this, m, and radii below that, m, have no path.
LARGEST, SMALLEST_RADIUS = 1e6, 1e-3
#: Rounding of an angle, rad: one as little below 0 is 0, not a full circle.
_ROUNDING = 1e-12


class Path(NamedTuple):
    """Segments, (n, k, 2), way (m, + forwards) and curvature (1/m, + left), and whether there is a path, (n,)."""

    segments: Floats
    ok: NDArray[np.bool_]


class Parking(NamedTuple):
    """A `Path` into a gap, and how far back it takes the rear axle, m, (n,)."""

    segments: Floats
    travel: Floats
    ok: NDArray[np.bool_]


def from_rear_axle(ahead: ArrayLike, wheelbase: float, front_overhang: float) -> Floats:
    """Return how far ahead of the rear axle a point is that the nose (camera) sees ``ahead`` of itself, m."""
    return np.asarray(ahead, dtype=np.float64) + (wheelbase + front_overhang)


def shortest_ahead(left: ArrayLike, radius: ArrayLike) -> Floats:
    """Return the least way ahead, m, to a target ``left``, m: ``radius`` both radii added, or one for an arc alone."""
    across = np.abs(np.asarray(left, dtype=np.float64))
    return np.sqrt(np.maximum(across * (2.0 * np.asarray(radius, dtype=np.float64) - across), 0.0))


def s_curve(ahead: ArrayLike, left: ArrayLike, radius_left: ArrayLike, radius_right: ArrayLike) -> Path:
    """Return arc, straight and opposite arc to a target in the present direction (25, 26), three segments.

    There is none exactly where the target is nearer than both radii to the point so far to its side. Targets behind
    have one too, which turns farther than `STEEPEST`.
    """
    ahead, left, to_left, to_right = _rows(ahead, left, radius_left, radius_right)
    straight, angle, ok = _tangent(ahead, np.abs(left), to_left + to_right, np.minimum(to_left, to_right))
    side = np.where(left < 0.0, -1.0, 1.0)
    first, last = np.where(side > 0.0, to_left, to_right), np.where(side > 0.0, to_right, to_left)
    ways, radii = (angle * first, straight, angle * last), (side * first, np.inf, -side * last)
    return _path(ways, radii, ok)


def arc_and_straight(ahead: ArrayLike, left: ArrayLike, radius_left: ArrayLike, radius_right: ArrayLike) -> Path:
    """Return arc and straight to a target (27, 28), two segments; the direction at its end is the arc's.

    The report prints the lateral equation twice; the one ahead is that of (25) with the one radius.
    """
    ahead, left, to_left, to_right = _rows(ahead, left, radius_left, radius_right)
    radius = np.where(left < 0.0, to_right, to_left)
    straight, angle, ok = _tangent(ahead, np.abs(left), radius, radius)
    return _path((angle * radius, straight), (np.where(left < 0.0, -radius, radius), np.inf), ok)


def evade(
    ahead: ArrayLike, left: ArrayLike, radius_left: ArrayLike, radius_right: ArrayLike, reverse: ArrayLike
) -> Floats:
    """Return the report's path to a target, (n, 3, 2): S-curve, else arc and straight, else ``reverse`` m backwards.

    The first two count where they turn by `STEEPEST` or less. Segments that a path lacks are 0.
    """
    ahead, left, to_left, to_right, reverse = _rows(ahead, left, radius_left, radius_right, reverse)
    back = np.zeros((len(ahead), 3, 2))
    back[:, 0, 0] = -np.abs(np.where(np.isnan(reverse), 0.0, reverse))
    curve, arc = s_curve(ahead, left, to_left, to_right), arc_and_straight(ahead, left, to_left, to_right)
    padded = np.concatenate([arc.segments, np.zeros_like(arc.segments[:, :1])], axis=1)
    segments = np.where(_gentle(arc)[:, None, None], padded, back)
    return np.where(_gentle(curve)[:, None, None], curve.segments, segments)


def parallel_parking(shift: ArrayLike, radius_right: ArrayLike, radius_left: ArrayLike) -> Parking:
    """Return the path back into a gap on the right: arc right, straight, arc left, all backwards (30 to 37).

    ``shift`` is the way to the right, m, to the line on which the rear axle's middle shall stand. Arcs are
    `PARKING_ANGLE` with a straight between them; for a shift too small for that they are smaller, without straight.
    The straight is what (35) means: it prints its subtrahend doubled, which made it negative.
    """
    shift, to_right, to_left = _rows(shift, radius_right, radius_left)
    ok = (shift >= 0.0) & (np.minimum(to_right, to_left) >= SMALLEST_RADIUS)
    both = np.where(ok, to_right + to_left, 1.0)
    across = np.where(ok, shift, 0.0)
    between = np.maximum(across - both * (1.0 - np.cos(PARKING_ANGLE)), 0.0)
    angle = np.where(between > 0.0, PARKING_ANGLE, np.arccos(np.maximum(1.0 - across / both, -1.0)))
    angle = np.minimum(angle, PARKING_ANGLE)
    ways = -angle * to_right, -between / np.sin(PARKING_ANGLE), -angle * to_left
    segments, ok = _path(ways, (-to_right, np.inf, to_left), ok)
    travel = both * np.sin(angle) + between / np.tan(PARKING_ANGLE)
    return Parking(segments, np.where(ok, travel, 0.0), ok)


def shortest_gap(rear_overhang: float, length: float, width: float, radius: float) -> float:
    """Return the shortest gap, m, that one sweep backwards enters behind an equally wide car, without a margin.

    ``length`` and ``width`` are the body's, ``radius`` the last arc's; the car stands along the kerb in the end.
    """
    return rear_overhang + float(np.sqrt((length - rear_overhang) ** 2 + 2.0 * radius * width))


def drive(segments: ArrayLike, pose: ArrayLike) -> Floats:
    """Return where the rear axle is after all segments, (n, 3): x, y (m) and heading (rad, not wrapped)."""
    parts, place = np.asarray(segments, dtype=np.float64), np.asarray(pose, dtype=np.float64)
    for k in range(parts.shape[1]):
        place = roll(place, parts[:, k, 0], parts[:, k, 1])
    return place


def roll(pose: ArrayLike, way: ArrayLike, curvature: ArrayLike) -> Floats:
    """Return the poses (..., 3) after a ``way``, m, at one curvature, 1/m, of any shape that fits."""
    start, length = np.asarray(pose, dtype=np.float64), np.asarray(way, dtype=np.float64)
    half = 0.5 * length * np.asarray(curvature, dtype=np.float64)
    chord, direction = length * np.sinc(half / np.pi), start[..., 2] + half
    x, y = start[..., 0] + chord * np.cos(direction), start[..., 1] + chord * np.sin(direction)
    return np.stack([x, y, direction + half], axis=-1)


def _rows(*values: ArrayLike) -> tuple[Floats, ...]:
    """Return the values as rows of one length, (n,), NaN for those that have no path."""
    rows = np.broadcast_arrays(*(np.atleast_1d(np.asarray(value, dtype=np.float64)) for value in values))
    return tuple(np.where(np.abs(row) <= LARGEST, row, np.nan) for row in rows)


def _tangent(ahead: Floats, across: Floats, radius: Floats, tightest: Floats) -> tuple[Floats, Floats, NDArray]:
    """Return straight (m), angle (rad, [0, 2 pi)) and whether there is a way: round a circle, then along its tangent.

    The circle has ``radius`` and its middle beside the start, on the target's side.
    """
    square = ahead**2 + across * (across - 2.0 * radius)
    ok = (square >= 0.0) & (tightest >= SMALLEST_RADIUS)
    straight = np.sqrt(np.where(ok, square, 0.0))
    ahead, across, radius = (np.where(ok, value, 0.0) for value in (ahead, across, radius))
    angle = np.arctan2(radius, straight) - np.arctan2(radius - across, ahead)
    angle = np.where(angle < -_ROUNDING, angle + 2.0 * np.pi, np.maximum(angle, 0.0))
    return straight, angle, ok


def _path(ways: tuple[Floats, ...], radii: tuple[Floats | float, ...], ok: NDArray[np.bool_]) -> Path:
    """Return the path of these ways on circles of signed radii, inf for a straight."""
    curvatures = [1.0 / np.where(ok, radius, np.inf) for radius in radii]
    segments = [np.stack([np.where(ok, way, 0.0), bend], axis=1) for way, bend in zip(ways, curvatures, strict=True)]
    return Path(np.stack(segments, axis=1), ok)


def _gentle(path: Path) -> NDArray[np.bool_]:
    """Return where there is a path that turns by `STEEPEST` or less."""
    return path.ok & (np.abs(path.segments[:, 0, 0] * path.segments[:, 0, 1]) <= STEEPEST + _ROUNDING)
