"""The cells of a map that can be reached from one of them, and the borders around them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.bool_]

#: Most walls that a map may have: more take longer to meet than a car takes to drive on (5 ms a step and more).
MOST_WALLS = 100_000


def reached_from(free: Cells, row: int, column: int) -> Cells:
    """Return the free cells that share edges with one another and with the given free one.

    Runs of free cells are joined, not cells one by one: the time is that of a few passes over the cells, however the
    free ones wind.
    """
    if _count_runs(free.T) < _count_runs(free):
        return reached_from(np.ascontiguousarray(free.T), column, row).T
    # A closed column at the end keeps the runs of a row from those of the next.
    flat, wide = np.pad(free, ((0, 0), (0, 1))).ravel(), free.shape[1] + 1
    begin = _rises(flat)
    # Each run of cells that are free in two rows joins one run with one other.
    place = _rises(flat[:-wide] & flat[wide:])
    above = np.searchsorted(begin, place, side="right") - 1
    below = np.searchsorted(begin, place + wide, side="right") - 1
    label = _joined(above, below, len(begin))
    mine = label == label[np.searchsorted(begin, row * wide + column, side="right") - 1]
    # Ones from the begin of each run that is reached to its end.
    steps = np.zeros(len(flat), np.int8)
    steps[begin[mine]] = 1
    steps[np.flatnonzero(flat[:-1] > flat[1:])[mine] + 1] = -1
    return np.cumsum(steps, dtype=np.int8).view(np.bool_).reshape(-1, wide)[:, :-1]


def _count_runs(free: Cells) -> int:
    return int(np.count_nonzero(free[:, 1:] > free[:, :-1]) + np.count_nonzero(free[:, 0]))


def _rises(flat: Cells) -> NDArray[np.intp]:
    """Indices at which runs of True begin."""
    return np.flatnonzero(np.concatenate([flat[:1], flat[1:] > flat[:-1]]))


def _joined(a: NDArray[np.integer], b: NDArray[np.integer], count: int) -> NDArray[np.int64]:
    """Label ``count`` things so that two have one label if and only if the pairs (a[k], b[k]) link them.

    The pairs are contracted: everything that has a pair takes the smallest label it is paired with, if smaller than
    its own. Two such rounds at least halve the labels that still have pairs.
    """
    label = np.arange(count)
    while len(a):
        np.minimum.at(label, np.maximum(a, b), np.minimum(a, b))
        while not np.array_equal(label, further := label[label]):
            label = further
        a, b = label[a], label[b]
        apart = a != b
        a, b = a[apart], b[apart]
    return label


def borders(reached: Cells) -> NDArray[np.int64]:
    """Borders between cells that are reached and those that are not, x0, y0, x1, y1 in cells, (n, 4).

    Cell (row, column) covers column..column+1 x row..row+1. Edges in one line that touch are one border.

    Raises:
        ValueError: there are more than `MOST_WALLS`.
    """
    level, upright = _steps(reached[:-1] != reached[1:]), _steps((reached[:, :-1] != reached[:, 1:]).T)
    count = int(np.count_nonzero(level == 1) + np.count_nonzero(upright == 1))
    if count > MOST_WALLS:
        raise ValueError(
            f"the cells that can be reached have {count} walls around them, allowed are {MOST_WALLS} "
            f"(is the picture noisy, or far finer than a car needs?)"
        )
    row, first, last = _runs(level)
    column, low, high = _runs(upright)
    return np.concatenate(
        [np.column_stack([first, row + 1, last, row + 1]), np.column_stack([column + 1, low, column + 1, high])]
    )


def _steps(edges: Cells) -> NDArray[np.int8]:
    """Where runs of True along the lines of an array begin (1) and end (-1)."""
    ones = np.pad(edges, ((0, 0), (1, 1))).view(np.int8)
    return ones[:, 1:] - ones[:, :-1]


def _runs(steps: NDArray[np.int8]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Line, begin and end of each run."""
    line, begin = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return line, begin, end
