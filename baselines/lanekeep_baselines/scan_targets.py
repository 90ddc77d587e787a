"""Where a scan lets the car pass: jump points, the free space beside them, the target (KnightRiders, 4.3.1).

A jump point is the nearer side of a jump of the range. Points count from the nose, m.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_classes import Perception
from lanekeep_env.scenario import Scan

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


def jumps(place: Floats, camera: Scan, rule: Perception) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which points (n, beams, 2) have a jump beside them to what is farther: on their left, on their right."""
    ranges = np.hypot(place[..., 0], place[..., 1])
    left = _rises(ranges, camera.step, rule)
    return left, _rises(ranges[:, ::-1], camera.step, rule)[:, ::-1]


def _rises(ranges: Floats, step: float, rule: Perception) -> NDArray[np.bool_]:
    """Return the last beams before the range rises by a jump within ``span`` beams."""
    slope, span = rule.step_slope * step * ranges, rule.span
    found = np.zeros(ranges.shape, dtype=bool)
    found[:, :-span] = ranges[:, span:] - ranges[:, :-span] > rule.jump + slope[:, :-span]
    for k in range(1, span):  # the same jump, seen from the beams before it
        same = found[:, k:] & (ranges[:, k:] <= ranges[:, :-k] + k * (rule.step_limit + slope[:, :-k]))
        found[:, :-k] &= ~same
    return found


def free_beside(place: Floats, beam: NDArray[np.int64], side: ArrayLike, rule: Perception) -> NDArray[np.bool_]:
    """Return whether all points beyond ``beam`` (n,) on its ``side`` (1 left, -1 right) are far enough from it.

    With a ``span`` of 2 the beam beside the jump does not count: it may show something between both sides.
    """
    off = place - np.take_along_axis(place, beam[:, None, None], axis=1)
    beyond = np.asarray(side)[..., None] * (np.arange(place.shape[1]) - beam[:, None]) >= rule.span
    return np.all(~beyond | (np.hypot(off[..., 0], off[..., 1]) >= rule.free), axis=1)


def jump_point(place: Floats, camera: Scan, rule: Perception) -> JumpPoint:
    """Return the nearest usable jump point in the points (n, beams, 2) of a camera's scan."""
    ranges = np.hypot(place[..., 0], place[..., 1])
    near = [found & (ranges < NEAR) for found in jumps(place, camera, rule)]
    sides = np.stack([np.where(found, ranges, np.inf) for found in near], axis=1)
    rows, beams = ranges.shape
    waiting = sides.reshape(rows, 2 * beams)
    chosen, found = np.zeros(rows, dtype=np.int64), np.zeros(rows, dtype=bool)
    for _ in range(TRIED):
        best = waiting.argmin(axis=1)
        there = np.isfinite(np.take_along_axis(waiting, best[:, None], axis=1)[:, 0]) & ~found
        if not there.any():
            break
        fits = there & free_beside(place, best % beams, np.where(best < beams, 1.0, -1.0), rule)
        chosen, found = np.where(fits, best, chosen), found | fits
        np.put_along_axis(waiting, best[:, None], np.inf, axis=1)
    chosen_place = np.take_along_axis(place, (chosen % beams)[:, None, None], axis=1)[:, 0]
    wider = np.where(ranges[:, -1] >= ranges[:, 0], 1.0, -1.0)
    side = np.where(found, np.where(chosen < beams, 1.0, -1.0), wider)
    ahead, left = np.where(found, chosen_place.T, 0.0)
    return JumpPoint(ahead, left, side, found)
