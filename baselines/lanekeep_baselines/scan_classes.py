"""What is ahead in a scan: a wall, an obstacle or nothing (KnightRiders, 4.2), as published and improved.

A point inside the detection box is the hit. From it the scan is walked along to both sides until a point is `REACH`
away: a wall. A step too large to be the same surface before that: an obstacle. A wall nearly along the car's direction
is nothing, the controller's business. Elementwise over the rows; along the beams sums and extremes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_points import WIDTH, bridged, filled, median, points
from lanekeep_env.scenario import Scan

NOTHING, WALL, OBSTACLE = 0, 1, 2
KINDS = ("nothing", "wall", "obstacle")
#: The walk's length to either side, m, and the angle up to which the controller manages, rad (the report's).
REACH, SMALL = 0.5, float(np.deg2rad(10.0))
#: What an improved line may be off by in its second fit, m.
_OUTLIER = 0.05


@dataclass(frozen=True)
class Perception:
    """How a scan is read. The report leaves box, step and jump limits open: those are decisions.

    Attributes:
        window: beams of the median; bridge: lost beams in a row that are put in from their neighbours, at a rim
            twice as many.
        box_ahead, box_side: the detection box ahead of the nose and to either side, m.
        neighbours: points beside the hit that have to be in the box as well.
        step_limit, step_slope: largest change of the range from beam to beam on one surface, m, and what is added to it
            for the surface's slope: that many times the beams' distance.
        shortest: what has to be seen of a wall that leaves the view before `REACH`, m.
        blind: how near to the camera's nearest range a surface is, m, that goes on unseen where beams show nothing.
        looks: hits that are tried, one behind another, while the first are of a wall that is nothing.
        fitted: the wall's direction by least squares, else by the ends of the walk.
        jump, span: change of the range that is a jump, m, within that many beams.
        free: free space beside a jump point, m.
    """

    window: int = WIDTH
    bridge: int = 0
    box_ahead: float = 1.0
    box_side: float = 0.25
    neighbours: int = 0
    step_limit: float = 0.1
    step_slope: float = 0.0
    shortest: float = 0.0
    blind: float = -np.inf
    looks: int = 1
    fitted: bool = False
    jump: float = 0.3
    span: int = 1
    free: float = 0.5

    def points(self, raw: Floats, camera: Scan) -> Floats:
        """Return the points (n, beams, 2), m, of a scan (n, beams), m, without gaps and filtered."""
        whole = bridged(raw, camera.farthest, self.bridge) if self.bridge else filled(raw, camera.farthest)
        return points(median(whole, self.window), -0.5 * camera.field_of_view, camera.step)


#: As in the report.
PUBLISHED = Perception()
#: Small obstacles stay, single lost beams say nothing, a slope may be steep where beams are far apart (8 times their
#: distance: 83 degrees), a wall goes on where it is too near to be seen, and the box is as wide as the body with 0.1 m
#: beside it and long enough for an S-curve.
IMPROVED = Perception(
    window=5, bridge=4, box_ahead=1.2, box_side=0.235, neighbours=1, step_limit=0.06, step_slope=8.0, shortest=0.5,
    blind=0.15, looks=3, fitted=True, span=2, free=0.465,
)  # fmt: skip


class Seen(NamedTuple):
    """What is ahead, (n,) each.

    Attributes:
        kind: `NOTHING`, `WALL` or `OBSTACLE`.
        angle: a wall's direction, rad in (-pi/2, pi/2], + left: that far the car turns to be along it; else 0.
        hit: the beam in the box that was found first, or that of the last look; -1 without one.
        first, last: the beams that the walk from it went over.
    """

    kind: NDArray[np.int64]
    angle: Floats
    hit: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]


def in_box(place: Floats, rule: Perception) -> NDArray[np.bool_]:
    """Return which points (n, beams, 2) are inside the detection box."""
    return (place[..., 0] <= rule.box_ahead) & (np.abs(place[..., 1]) <= rule.box_side)


def walk(place: Floats, hit: NDArray[np.int64], camera: Scan, rule: Perception) -> tuple[NDArray, NDArray, NDArray]:
    """Return the first and last beam of the hit's surface within `REACH`, and whether no step broke it off, (n,) each.

    Decision: the rim of the view breaks nothing off where enough of the wall is seen.
    """
    ranges = np.hypot(place[..., 0], place[..., 1])
    beams = np.arange(ranges.shape[1])
    at = hit.clip(0)[:, None]
    nearer = np.minimum(ranges[:, 1:], ranges[:, :-1])
    broken = np.abs(np.diff(ranges, axis=1)) > rule.step_limit + rule.step_slope * camera.step * nearer
    unseen = np.maximum(ranges[:, 1:], ranges[:, :-1]) >= 0.999 * camera.farthest
    rim = broken & unseen & (nearer <= camera.nearest + rule.blind)
    away = np.hypot(*np.moveaxis(place - np.take_along_axis(place, at[..., None], axis=1), 2, 0)) >= REACH
    to_left, to_right, end = beams[:-1] >= at, beams[:-1] < at, len(beams)
    last_step = np.where(broken & ~rim & to_left, beams[:-1], end).min(axis=1)
    last_far = np.where(away & (beams > at), beams, end - 1).min(axis=1)
    last_far = np.minimum(last_far, np.where(rim & to_left, beams[:-1], end).min(axis=1))
    first_step = np.where(broken & ~rim & to_right, beams[1:], -1).max(axis=1)
    first_far = np.where(away & (beams < at), beams, 0).max(axis=1)
    first_far = np.maximum(first_far, np.where(rim & to_right, beams[1:], -1).max(axis=1))
    first, last = np.maximum(first_step, first_far), np.minimum(last_step, last_far)
    whole = (last_step >= last_far) & (first_step <= first_far)
    seen = np.hypot(*(_at(place, last) - _at(place, first)).T)
    return first, last, whole & (seen >= rule.shortest)


def direction(place: Floats, first: NDArray[np.int64], last: NDArray[np.int64], fitted: bool) -> Floats:
    """Return the direction of the points from ``first`` to ``last``, rad in (-pi/2, pi/2], + left.

    Published: by the wall's intercepts with both axes; with the mean gradient from end to end and the middle beam's
    intercept, the latter cancels. The printed quotient is the angle to the lateral axis, with which a wall straight
    across would be "nothing": its complement is meant. Fitted: least squares across the line, a second time without
    points off the first.
    """
    if not fitted:
        along = _at(place, last) - _at(place, first)
        return _half_turn(np.arctan2(along[:, 1], along[:, 0]))
    beams = np.arange(place.shape[1])
    used = (beams >= first[:, None]) & (beams <= last[:, None])
    off = _line(place, used)[1]
    mean = np.where(used, off, 0.0).sum(axis=1) / used.sum(axis=1)
    close = used & (off <= np.maximum(_OUTLIER, mean)[:, None])
    return _half_turn(_line(place, close)[0])


def classify(place: Floats, camera: Scan, rule: Perception) -> Seen:
    """Return what is ahead in the points (n, beams, 2) of a camera's scan."""
    inside = in_box(place, rule)
    for shift in range(1, rule.neighbours + 1):
        inside[:, shift:-shift] &= inside[:, 2 * shift :] & inside[:, : -2 * shift]
    beams = np.arange(place.shape[1])
    seen = _look(place, inside, camera, rule)
    for _ in range(rule.looks - 1):
        inside &= (beams < seen.first[:, None]) | (beams > seen.last[:, None])
        again = (seen.hit >= 0) & (seen.kind == NOTHING) & inside.any(axis=1)
        other = _look(place, inside, camera, rule)
        seen = Seen(*(np.where(again, new, old) for new, old in zip(other, seen, strict=True)))
    return seen


def _look(place: Floats, inside: NDArray[np.bool_], camera: Scan, rule: Perception) -> Seen:
    """Return what one hit is: published the first from the right, with ``neighbours`` the nearest one."""
    ranges = np.hypot(place[..., 0], place[..., 1])
    order = np.where(inside, ranges, np.inf).argmin(axis=1) if rule.neighbours else inside.argmax(axis=1)
    found = inside.any(axis=1)
    hit = np.where(found, order, -1)
    first, last, whole = walk(place, hit, camera, rule)
    angle = direction(place, first, last, rule.fitted)
    kind = np.where(whole, np.where(np.abs(angle) < SMALL, NOTHING, WALL), OBSTACLE)
    kind = np.where(found, kind, NOTHING)
    return Seen(kind, np.where(kind == WALL, angle, 0.0), hit, np.where(found, first, 0), np.where(found, last, -1))


def _at(place: Floats, beam: NDArray[np.int64]) -> Floats:
    """Return one point of each row, (n, 2)."""
    return np.take_along_axis(place, beam[:, None, None], axis=1)[:, 0]


def _line(place: Floats, used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Return the direction of the line nearest to the used place, rad, (n,), and how far each is off, m."""
    count = np.maximum(used.sum(axis=1), 1)
    x, y = (np.where(used, place[..., k], 0.0) for k in (0, 1))
    x, y = (value - (value.sum(axis=1) / count)[:, None] for value in (x, y))
    xx, yy, xy = ((np.where(used, value, 0.0)).sum(axis=1) for value in (x * x, y * y, x * y))
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    return angle, np.abs(y * np.cos(angle)[:, None] - x * np.sin(angle)[:, None])


def _half_turn(angle: Floats) -> Floats:
    """Return the direction of a line in (-pi/2, pi/2]."""
    return 0.5 * np.pi - np.mod(0.5 * np.pi - angle, np.pi)
