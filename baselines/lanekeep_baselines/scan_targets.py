"""Where a scan lets the car pass: jump points, the free space beside them, the target (KnightRiders, 4.3.1).

A jump point is the nearer side of a jump of the range. Points count from the nose, m.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_classes import Perception

#: Jump points count up to here, and the published target is so far to their side, m (the report's). The latter leaves
#: 6.8 cm to a body of 0.265 m along the straight, and less where the body swings.
NEAR, ASIDE = 1.5, 0.2
#: Decision: jump points that are tried, nearest first.
TRIED = 8


class JumpPoint(NamedTuple):
    """The nearest jump point with free space beside it, (n,) each.

    Attributes:
        ahead, left: its place, m; 0 where none is found.
        side: 1 to pass on its left, -1 on its right; without one the side whose outermost beam is the longer.
        found: whether there is one.
    """

    ahead: Floats
    left: Floats
    side: Floats
    found: NDArray[np.bool_]

    def target(self, aside: ArrayLike) -> tuple[Floats, Floats]:
        """Return the place ``aside`` m beside the jump point, ahead and to the left, m."""
        return self.ahead, self.left + np.where(self.found, self.side * np.asarray(aside, dtype=np.float64), 0.0)


def jump_points(points: Floats, rule: Perception) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which points (n, beams, 2) end at a jump and are nearer than `NEAR`: to pass on their left, right."""
    ranges = np.hypot(points[..., 0], points[..., 1])
    left, right = np.zeros(ranges.shape, dtype=bool), np.zeros(ranges.shape, dtype=bool)
    wider = ranges[:, rule.span :] - ranges[:, : -rule.span]
    left[:, : -rule.span] = wider > rule.jump
    right[:, rule.span :] = wider < -rule.jump
    # Of the beams whose jump is the same one the last before it is the point.
    for k in range(1, rule.span):
        left[:, :-k] &= ~(left[:, k:] & (ranges[:, k:] <= ranges[:, :-k] + rule.step_limit))
        right[:, k:] &= ~(right[:, :-k] & (ranges[:, :-k] <= ranges[:, k:] + rule.step_limit))
    return left & (ranges < NEAR), right & (ranges < NEAR)


def free_beside(points: Floats, beam: NDArray[np.int64], side: ArrayLike, free: float) -> NDArray[np.bool_]:
    """Return whether all points beyond ``beam`` (n,) on its ``side`` (1 left, -1 right) are ``free`` m away from it."""
    place = np.take_along_axis(points, beam[:, None, None], axis=1)
    away = np.hypot(*np.moveaxis(points - place, 2, 0))
    beams = np.arange(points.shape[1])
    beyond = np.asarray(side)[..., None] * (beams - beam[:, None]) > 0.0
    return np.all(~beyond | (away >= free), axis=1)


def jump_point(points: Floats, rule: Perception) -> JumpPoint:
    """Return the nearest usable jump point in points (n, beams, 2)."""
    ranges = np.hypot(points[..., 0], points[..., 1])
    sides = np.stack([np.where(jumps, ranges, np.inf) for jumps in jump_points(points, rule)], axis=1)
    rows, beams = ranges.shape
    waiting = sides.reshape(rows, 2 * beams)
    chosen, found = np.zeros(rows, dtype=np.int64), np.zeros(rows, dtype=bool)
    for _ in range(TRIED):
        best = waiting.argmin(axis=1)
        there = np.isfinite(np.take_along_axis(waiting, best[:, None], axis=1)[:, 0]) & ~found
        if not there.any():
            break
        fits = there & free_beside(points, best % beams, np.where(best < beams, 1.0, -1.0), rule.free)
        chosen, found = np.where(fits, best, chosen), found | fits
        np.put_along_axis(waiting, best[:, None], np.inf, axis=1)
    place = np.take_along_axis(points, (chosen % beams)[:, None, None], axis=1)[:, 0]
    wider = np.where(ranges[:, -1] >= ranges[:, 0], 1.0, -1.0)
    side = np.where(found, np.where(chosen < beams, 1.0, -1.0), wider)
    return JumpPoint(np.where(found, place[:, 0], 0.0), np.where(found, place[:, 1], 0.0), side, found)
