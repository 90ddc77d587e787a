"""Free space around a car: which of a fan of short paths its body can drive, and how far, among points of walls.

The paths and the body are known before the first step. So a table tells for each cell around the car after which way
each path first meets it, and what a step costs is a look-up a point and the least of each path.

Points and paths are in the frame of the car: from the rear axle, x ahead and y to the left, m.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats

#: Side of a cell, m, and what the table covers: x and y from and to, m.
CELL = 0.025
LOW, HIGH = (-1.6, -2.4), (3.8, 2.4)
#: Way between two poses of a path, m, and how many of them: the paths are 3.2 m long, those backwards 0.8 m.
STRIDE, STRIDES, BACKWARDS = 0.04, 80, 20
#: Shares of the largest curvature that paths begin with, on either side.
SHARES = (0.0, 0.06, 0.13, 0.22, 0.34, 0.48, 0.64, 0.82, 1.0)
#: Ways after which paths with these shares go on straight, or to the other side, m.
BENT, STRAIGHT_AFTER, OTHER_AFTER = (0.34, 0.64, 1.0), (0.1, 0.2, 0.35, 0.55, 0.9), (0.1, 0.2, 0.35, 0.55)
#: Where no point is, m: off the table.
NOWHERE = 1e3


class Body(NamedTuple):
    """A car's body: how far it reaches ahead of and behind the rear axle, and half its width, m."""

    ahead: float
    behind: float
    half_width: float


class Fan(NamedTuple):
    """Paths, (paths,) each.

    Attributes:
        first: curvature that they begin with, 1/m.
        second: and end with, 1/m.
        piece: way after which it changes, m.
        sign: 1 forwards, -1 backwards.
        turn: by which they have turned at their end, rad.
    """

    first: Floats
    second: Floats
    piece: Floats
    sign: Floats
    turn: Floats


def fan(tightest: float) -> Fan:
    """Return the paths of a car whose largest curvature is ``tightest``, 1/m."""
    both = sorted({side * share for share in SHARES for side in (-1.0, 1.0)})
    rows = [(share, share, 9.0, 1.0) for share in both]
    for share in (share for share in both if abs(share) in BENT):
        rows += [(share, 0.0, piece, 1.0) for piece in STRAIGHT_AFTER]
        rows += [(share, -share, piece, 1.0) for piece in OTHER_AFTER]
    rows += [(share, share, 9.0, -1.0) for share in both if abs(share) in (0.0, *BENT)]
    first, second, piece, sign = np.array(rows).T
    length = np.where(sign > 0.0, STRIDE * STRIDES, STRIDE * BACKWARDS)
    turn = first * np.minimum(piece, length) + second * np.maximum(length - piece, 0.0)
    return Fan(first * tightest, second * tightest, piece, sign, turn * tightest * sign)


def poses(paths: Fan) -> tuple[Floats, Floats, Floats]:
    """Return x, y (m) and heading (rad) of the rear axle along each path, (STRIDES + 1, paths)."""
    way = STRIDE * np.arange(STRIDES + 1)[:, None]
    turned = paths.first * np.minimum(way, paths.piece) + paths.second * np.maximum(way - paths.piece, 0.0)
    heading = paths.sign * turned
    middle = 0.5 * (heading[1:] + heading[:-1])
    step = paths.sign * STRIDE
    zero = np.zeros((1, len(paths.first)))
    x = np.concatenate([zero, np.cumsum(step * np.cos(middle), axis=0)])
    y = np.concatenate([zero, np.cumsum(step * np.sin(middle), axis=0)])
    return x, y, heading


class Margin(NamedTuple):
    """Room around the body at a path's begin and from `GROWN` m on, m, and whether it is lenient.

    Strictly, a point within it at the start blocks every path; leniently only those that come nearer to it, or nothing
    could leave a wall.
    """

    begin: float
    end: float
    lenient: bool


#: Way in which margins grow, m.
GROWN = 0.8


class FreeSpace:
    """The table of a body and its paths, with a strict, a usual, a comfortable and a least margin."""

    MARGINS = (Margin(0.05, 0.10, False), Margin(0.04, 0.06, True), Margin(0.14, 0.14, True), Margin(0.0, 0.02, True))

    def __init__(self, body: Body, tightest: float) -> None:
        self.paths = fan(tightest)
        self._table = _table(body, tightest, self.MARGINS)
        self._wide = round((HIGH[1] - LOW[1]) / CELL)
        self._deep = round((HIGH[0] - LOW[0]) / CELL)

    def free(self, x: Floats, y: Floats) -> tuple[Floats, ...]:
        """Return how far each path is free, m, (n, paths) for each of the `MARGINS`.

        Args:
            x, y: the points, m, (points, n).
        """
        column, row = np.floor((x - LOW[0]) / CELL), np.floor((y - LOW[1]) / CELL)
        inside = (column >= 0) & (column < self._deep) & (row >= 0) & (row < self._wide)
        cell = np.where(inside, column * self._wide + row, len(self._table) - 1).astype(np.int64)
        strides = self._table[cell].min(axis=0) * STRIDE
        return tuple(np.split(strides, len(self.MARGINS), axis=1))


@lru_cache(maxsize=8)
def _table(body: Body, tightest: float, margins: tuple[Margin, ...]) -> NDArray[np.uint8]:
    """Return the strides after which each path meets each cell, (cells + 1, margins x paths); none meets the last."""
    paths = fan(tightest)
    x, y, heading = poses(paths)
    wide, deep = round((HIGH[1] - LOW[1]) / CELL), round((HIGH[0] - LOW[0]) / CELL)
    longest = np.where(paths.sign > 0.0, STRIDES, BACKWARDS)
    last = np.concatenate([longest] * len(margins))
    table = np.broadcast_to(last.astype(np.uint8), (deep * wide + 1, len(last))).copy()
    reach = np.hypot(max(body.ahead, body.behind), body.half_width) + max(margin.end for margin in margins)
    around = np.arange(-np.ceil(reach / CELL), np.ceil(reach / CELL) + 1)
    window = np.stack(np.meshgrid(around, around, indexing="ij")).reshape(2, -1, 1)
    which = np.broadcast_to(np.arange(len(paths.first)), (window.shape[1], len(paths.first)))
    for k in range(STRIDES, -1, -1):
        column, row = window[0] + np.floor((x[k] - LOW[0]) / CELL), window[1] + np.floor((y[k] - LOW[1]) / CELL)
        px, py = LOW[0] + (column + 0.5) * CELL, LOW[1] + (row + 0.5) * CELL
        on = (column >= 0) & (column < deep) & (row >= 0) & (row < wide) & (k <= longest)
        outside = _outside(body, px - x[k], py - y[k], heading[k])
        near = _outside(body, px, py, 0.0 * heading[k])
        for m, (begin, end, lenient) in enumerate(margins):
            margin = begin + (end - begin) * min(1.0, k * STRIDE / GROWN)
            least = np.where(near <= margin, near - 0.5 * CELL, margin) if lenient else margin
            hit = on & (outside <= least) & (near > 0.0)
            cell = (column * wide + row)[hit].astype(np.int64)
            table[cell, m * len(paths.first) + which[hit]] = k
    table.setflags(write=False)
    return table


def _outside(body: Body, dx: Floats, dy: Floats, heading: Floats) -> Floats:
    """Return how far points are outside of a body, along the farther of its axes, m; negative inside."""
    cosine, sine = np.cos(heading), np.sin(heading)
    ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
    return np.maximum(np.maximum(ahead - body.ahead, -ahead - body.behind), np.abs(left) - body.half_width)
