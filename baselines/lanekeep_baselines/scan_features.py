"""What a depth camera's scan tells between walls: the wall ahead, and side walls that end (KnightRiders, 4.3.3).

The report searches the scan from its rim to its middle: a wall with a small slope, 0.75 to 2 m long, then a jump, and
0.5 m of free space behind. Here a beam is judged by itself, with the side wall known from distance and heading: it
passes if it goes on by 0.5 m behind the place where the wall would have stopped it. The wall ends between the
outermost beam that passes and the beams that the wall stops; no slope is needed, and a few lost beams do no harm.

Angles and places count in the leg's frame, from the camera: along the walls and to the left.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_env.scenario import Scan


class WallEnd(NamedTuple):
    """Where a side wall ends, (n,) each: between ``near`` and ``far`` m ahead; far is inf where no end is seen."""

    near: Floats
    far: Floats

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether an end is seen."""
        return np.isfinite(self.far)

    def about(self, place: Floats, margin: float) -> WallEnd:
        """Return the end where ``place`` (m, (n,)) is within ``margin`` of it, none elsewhere."""
        agrees = (place >= self.near - margin) & (place <= self.far + margin)
        return WallEnd(self.near, np.where(agrees, self.far, np.inf))


class ScanReader:
    """Reads scans of one camera; elementwise over the rows, and along the beams only sorts and takes extremes.

    The report's median over 41 values, on a scan of 141 beams over 70 degrees (assumed: it tells neither), closes
    openings under 0.175 m at 1 m and hides a jump within 10 degrees of the rim. This one takes `WINDOW` beams of a
    faulty camera, leaves beams that show nothing out, and takes a perfect camera's as they are.
    """

    WINDOW = 5
    #: Free way behind the wall's line that makes a beam pass, m (the report's), and what that grows by with the way to
    #: that place, m/m: an error of the heading moves it.
    FREE, FREE_GROWTH = 0.5, 0.1
    #: A wall's end is looked for up to here, m (the report: 2 m), and at slopes of a beam from here on.
    FARTHEST, FLATTEST = 4.0, 0.25
    #: Half the angle around the leg's direction whose beams measure the wall ahead, rad.
    AHEAD = float(np.deg2rad(2.5))
    #: Share of the range up to which a wall ahead is believed.
    TRUSTED = 0.85
    #: Angle on either side within which the way is seen, rad.
    BESIDE = float(np.deg2rad(3.0))

    def __init__(self, scan: Scan) -> None:
        self.channels = tuple(f"scan_{k}" for k in range(scan.beams))
        self.angles = (np.arange(scan.beams) * scan.step - 0.5 * scan.field_of_view)[:, None]
        self.nearest, self._farthest = scan.nearest, scan.farthest
        faulty = scan.noise > 0.0 or scan.missing_every > 0 or scan.jump_errors > 0.0
        self._window = self.WINDOW if faulty else 1

    def ranges(self, beams: Floats) -> Floats:
        """Return the ranges (beams, n) filtered, inf where nothing is known."""
        known = np.where(beams > 0.0, beams, np.inf)
        if self._window == 1:
            return known
        half = self._window // 2
        edges = np.concatenate([known[:1].repeat(half, axis=0), known, known[-1:].repeat(half, axis=0)])
        return median(np.stack([edges[k : k + len(known)] for k in range(self._window)]))

    def bridged(self, ranges: Floats) -> Floats:
        """Return the ranges with straight walls where nothing is known between two beams: a window is in a wall."""
        beams = len(self.angles)
        known, number = np.isfinite(ranges), np.arange(beams)[:, None]
        before = np.maximum.accumulate(np.where(known, number, -1), axis=0)
        after = np.minimum.accumulate(np.where(known, number, beams)[::-1], axis=0)[::-1]
        between = (before >= 0) & (after < beams) & ~known
        low, high = np.where(between, before, 0), np.where(between, after, 0)
        one = np.where(between, np.take_along_axis(ranges, low, axis=0), 1.0)
        other = np.where(between, np.take_along_axis(ranges, high, axis=0), 1.0)
        angle = self.angles[:, 0]
        turn = one * np.sin(self.angles - angle[low]) + other * np.sin(angle[high] - self.angles)
        wall = one * other * np.sin(angle[high] - angle[low]) / np.where(between, turn, 1.0)
        return np.where(between, wall, ranges)

    def view(self, ranges: Floats, bearing: Floats) -> Floats:
        """Return how far it is seen in directions from the camera (rad, (directions,)), m, (n, directions).

        It is the least of a few beams, where nothing is known the farthest; beyond the rim that of the rim.
        """
        beams = len(self.angles)
        middle = np.clip(np.searchsorted(self.angles[:, 0], bearing), 0, beams - 1)
        half = max(1, round(self.BESIDE / (self.angles[1, 0] - self.angles[0, 0])))
        seen = np.minimum(ranges, self._farthest)
        edges = np.concatenate([seen[:1].repeat(half, axis=0), seen, seen[-1:].repeat(half, axis=0)])
        least = np.stack([edges[k : k + beams] for k in range(2 * half + 1)]).min(axis=0)
        return least[middle].T

    def ahead(self, ranges: Floats, heading: Floats) -> Floats:
        """Return the distance of the wall ahead along the leg, m, (n,), inf where less than half of it is known.

        Where it is out of range, beams beside it may show a side wall: what is near the end of the range is left out.
        """
        angle = self.angles + heading
        looks = np.abs(angle) <= self.AHEAD
        along = np.where(looks, ranges * np.cos(angle), np.inf)
        enough = 2 * np.isfinite(along).sum(axis=0) >= looks.sum(axis=0)
        wall = median(along)
        return np.where(enough & (wall <= self.TRUSTED * self._farthest), wall, np.inf)

    def wall_end(self, ranges: Floats, heading: Floats, distance: Floats, side: float) -> WallEnd:
        """Return where the wall at a ``distance`` (m, (n,)) of the camera ends; ``side`` is 1 left, -1 right."""
        angle = self.angles + heading
        slope = side * np.tan(angle)
        usable = np.isfinite(ranges) & (slope >= self.FLATTEST)
        stop = np.where(usable, distance / np.where(usable, slope, 1.0), np.inf)
        along = np.where(usable, ranges, 0.0) * np.cos(angle)
        usable &= stop <= self.FARTHEST
        passes = usable & (along - stop >= self.FREE + self.FREE_GROWTH * stop)
        far = np.where(passes, stop, np.inf).min(axis=0)
        near = np.where(usable & ~passes & (stop < far), np.minimum(along, stop), 0.0).max(axis=0)
        return WallEnd(near, far)


def median(values: Floats) -> Floats:
    """Return the (lower) median of the finite values along the first axis, inf where there is none."""
    order = np.sort(values, axis=0)
    count = np.isfinite(order).sum(axis=0)
    return np.take_along_axis(order, np.maximum(count - 1, 0)[None] // 2, axis=0)[0]
