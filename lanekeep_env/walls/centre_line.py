"""The middle of a map's circuit, between its outer wall and the largest thing that it goes round."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.walls.world import Floats

#: Most points of a centre line, and of each wall that it is measured against.
MOST_POINTS = 600
_MOST_WALL = 4000
#: Points that are moved, an eighth of the corridor's width apart where they suffice: fewer swing about at hairpins.
#: Nearer than two cells they would follow the cells' corners.
_MOST_MOVED, _SHARE, _APART = 2000, 0.125, 2.0
#: Times that they are moved at the most, and by how much the last time, cells.
_ROUNDS, _STILL = 20, 0.1
#: The inner wall of a circuit encloses at least this share of what the outer one does.
_SMALLEST = 0.02


def found(walls: NDArray[np.int64], most: int = MOST_POINTS) -> Floats:
    """Return points in the middle between two closed walls, evenly spaced, anticlockwise, in cells.

    Every point is moved away from the nearer wall until the nearest outer and the nearest inner one are equally far,
    and smoothed over a quarter of the corridor's width.

    Args:
        walls: of the cells that can be reached, x0, y0, x1, y1 in cells, (n, 4); see `borders`.
        most: points that it may have.

    Raises:
        ValueError: the cells do not go round anything.
    """
    loops = sorted(_loops(walls), key=lambda loop: -abs(_area(loop)))
    if len(loops) < 2 or abs(_area(loops[1])) < _SMALLEST * abs(_area(loops[0])):
        raise ValueError("the map is no circuit: its walls go round nothing large; give a centre_line")
    outer, inner = (_spaced(loop, _MOST_WALL) for loop in loops[:2])
    around = inner if _area(inner) > 0.0 else inner[::-1]
    width = 2.0 * (abs(_area(outer)) - abs(_area(inner))) / (_length(outer) + _length(inner))
    count = int(np.clip(_length(inner) / max(_SHARE * width, _APART), 16, _MOST_MOVED))
    line = _spaced(around, count)
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    line = line + np.column_stack([ahead[:, 1], -ahead[:, 0]]) / np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    for _ in range(_ROUNDS):
        before = line
        to_outer, far_outer = _nearest(outer, line)
        to_inner, far_inner = _nearest(inner, line)
        # Away from the nearer wall.
        aim = np.where((far_outer > far_inner)[:, None], to_inner / far_inner[:, None], to_outer / far_outer[:, None])
        line = line - 0.5 * np.abs(far_outer - far_inner)[:, None] * aim
        spacing = _length(line) / count
        line = _spaced(_smooth(line, 0.25 * float(np.median(far_outer + far_inner)) / max(spacing, 1e-9)), count)
        if np.hypot(*(line - before).T).max() < _STILL:
            break
    return _spaced(line, most)


def _loops(walls: NDArray[np.int64]) -> list[Floats]:
    """Closed polygons of walls that meet at their ends."""
    ends: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for x0, y0, x1, y1 in walls.tolist():
        ends.setdefault((x0, y0), []).append((x1, y1))
        ends.setdefault((x1, y1), []).append((x0, y0))
    loops = []
    while ends:
        first = here = next(iter(ends))
        loop = [first]
        while True:
            after = ends[here].pop()
            if not ends[here]:
                del ends[here]
            ends[after].remove(here)
            if not ends[after]:
                del ends[after]
            if after == first or after not in ends:
                break
            loop.append(after)
            here = after
        loops.append(np.array(loop, dtype=np.float64))
    return loops


def _area(loop: Floats) -> float:
    x, y = loop.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _length(loop: Floats) -> float:
    return float(np.hypot(*(np.roll(loop, -1, axis=0) - loop).T).sum())


def _spaced(loop: Floats, most: int) -> Floats:
    """Evenly spaced points on a closed polygon, at most one a cell."""
    closed = np.vstack([loop, loop[:1]])
    station = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    count = int(min(most, max(16.0, station[-1])))
    at = np.linspace(0.0, station[-1], count, endpoint=False)
    return np.column_stack([np.interp(at, station, closed[:, axis]) for axis in (0, 1)])


def _nearest(wall: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Vector to, and distance of, the nearest point of a wall."""
    # Squares of the distances, less those of the points: by one product of matrices.
    squares = np.column_stack([points, np.ones(len(points))]) @ np.vstack([-2.0 * wall.T, (wall**2).sum(axis=1)])
    to = wall[np.argmin(squares, axis=1)] - points
    return to, np.maximum(np.hypot(*to.T), 1e-9)


def _smooth(line: Floats, width: float) -> Floats:
    """Average of each point with its neighbours within ``width`` points to either side, by a binomial-like window."""
    reach = int(np.clip(round(width), 1, len(line) // 8))
    window = np.hanning(2 * reach + 3)[1:-1]
    window /= window.sum()
    padded = np.vstack([line[-reach:], line, line[:reach]])
    return np.column_stack([np.convolve(padded[:, axis], window, mode="valid") for axis in (0, 1)])
