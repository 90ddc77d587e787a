"""Pieces that walled worlds are made of: closed outlines, windows in them, lines with rounded corners."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_env.walls.world import Floats

#: Radius of the bends of a centre line where the corridor leaves room, m; a 1:10 car can drive it.
BEND_RADIUS = 0.8

# Rounded corners: angle from point to point, rad.
_ARC_STEP = math.radians(5.0)

# Shortest piece beside a window, as a share of the wall.
_SMALLEST_PIECE = 1e-6


def outline(corners: ArrayLike) -> Floats:
    """Walls along a closed polygon with the given corners (n, 2), m: (n, 4)."""
    points = np.asarray(corners, dtype=np.float64)
    return np.hstack([points, np.roll(points, -1, axis=0)])


def rectangle(length: float, width: float) -> Floats:
    """Corners of a rectangle around the origin, counter-clockwise from the lower left, m, (4, 2)."""
    return 0.5 * np.array([[-length, -width], [length, -width], [length, width], [-length, width]])


def with_windows(walls: Floats, share: float, rng: np.random.Generator) -> tuple[Floats, NDArray[np.bool_]]:
    """Give every wall (n, 4) one window over ``share`` of its length, at a drawn place.

    Returns:
        The walls, each split in up to three, and which of them are glass.
    """
    if share <= 0.0:
        return walls, np.zeros(len(walls), dtype=np.bool_)
    places = rng.random(len(walls)) * (1.0 - share)
    pieces, glass = [], []
    for wall, place in zip(walls, places, strict=True):
        # Cuts that are too near to an end fall onto it: the pieces always join.
        begin = 0.0 if place < _SMALLEST_PIECE else place
        end = 1.0 if place + share > 1.0 - _SMALLEST_PIECE else place + share
        a, b = wall[:2], wall[2:]
        points = [a, a + begin * (b - a), b if end == 1.0 else a + end * (b - a), b]
        for k, length in enumerate((begin, end - begin, 1.0 - end)):
            if length > 0.0:
                pieces.append(np.concatenate([points[k], points[k + 1]]))
                glass.append(k == 1)
    return np.array(pieces), np.array(glass, dtype=np.bool_)


def rounded(corners: ArrayLike, radius: float, closed: bool) -> Floats:
    """Polyline through corners (n, 2), m, each replaced by an arc of ``radius`` m (less where there is no room)."""
    points = np.asarray(corners, dtype=np.float64)
    n = len(points)
    line: list[Floats] = []
    for i, corner in enumerate(points):
        if not closed and i in (0, n - 1):
            line.append(corner[None])
            continue
        before, after = points[i - 1] - corner, points[(i + 1) % n] - corner
        room = 0.5 * min(np.hypot(*before), np.hypot(*after))
        back, ahead = before / np.hypot(*before), after / np.hypot(*after)
        turn = math.atan2(back[1] * ahead[0] - back[0] * ahead[1], -(back @ ahead))
        if abs(turn) < 1e-9:
            line.append(corner[None])
            continue
        tangent = min(radius * math.tan(abs(turn) / 2), room)
        bend = tangent / math.tan(abs(turn) / 2)
        side = math.copysign(1.0, turn)
        left = side * np.array([back[1], -back[0]])
        begin = corner + tangent * back
        centre = begin + bend * left
        angles = side * np.linspace(0.0, abs(turn), 1 + math.ceil(abs(turn) / _ARC_STEP))
        cosine, sine = np.cos(angles), np.sin(angles)
        dx, dy = begin - centre
        line.append(centre + np.column_stack([cosine * dx - sine * dy, sine * dx + cosine * dy]))
    return np.concatenate(line)


def bend_radius(width: float) -> float:
    """Radius of the bends of the middle line of a corridor of ``width`` m, m."""
    return max(0.5 * width, BEND_RADIUS)
