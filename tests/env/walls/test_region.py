"""What can be reached on a map: against SciPy's labels, and in time that does not grow with the bends."""

import time

import numpy as np
import pytest
from scipy import ndimage

from lanekeep_env.walls.region import MOST_WALLS, borders, reached_from


@pytest.mark.parametrize("share", [0.0, 0.3, 0.45, 0.6])
def test_reached_cells_are_those_with_one_label(share):
    rng = np.random.default_rng(0)
    for _ in range(60):
        free = rng.random(rng.integers(1, 40, 2)) >= share
        labels, _ = ndimage.label(free)
        for row, column in rng.permutation(np.argwhere(free))[:5]:
            expected = labels == labels[row, column]
            assert np.array_equal(reached_from(free, row, column), expected)


def snake(side):
    """A corridor of one cell to and fro through the whole picture, and its length."""
    free = np.zeros((side, side), bool)
    free[1:-1:2, 1:-1] = True
    turns = np.arange(2, side - 2, 2)
    free[turns, np.where(turns % 4 == 2, -2, 1)] = True
    return free


def spiral(side):
    free = np.zeros((side, side), bool)
    free[1, 1] = True
    row, column, step = 1, 1, 0
    for reach in sorted([*range(side - 3, 0, -2)] * 2, reverse=True):
        down, right = ((0, 1), (1, 0), (0, -1), (-1, 0))[step % 4]
        free[
            min(row, row + down * reach) : max(row, row + down * reach) + 1,
            min(column, column + right * reach) : max(column, column + right * reach) + 1,
        ] = True
        row, column, step = row + down * reach, column + right * reach, step + 1
    return free


@pytest.mark.parametrize("make", [snake, spiral])
@pytest.mark.parametrize("turned", [False, True])
def test_long_ways_take_no_longer_than_short_ones(make, turned):
    """A snake of 2001 x 2001 has half the cells behind one another: one by one they take minutes."""
    free = make(2001).T.copy() if turned else make(2001)
    labels, count = ndimage.label(free)
    begin = time.process_time()
    reached = reached_from(free, 1, 1)
    assert time.process_time() - begin < 5.0
    assert np.array_equal(reached, labels == labels[1, 1]) and count == 1
    assert len(borders(reached)) < 4 * 2001


def test_more_walls_than_a_car_can_drive_between_are_refused():
    side = 2 * int(np.sqrt(MOST_WALLS / 4)) + 3
    cells = np.zeros((side, side), bool)
    cells[1:-1:2, 1:-1:2] = True
    most = np.argwhere(cells)
    cells[tuple(most[MOST_WALLS // 4 :].T)] = False
    assert len(borders(cells)) == MOST_WALLS
    cells[tuple(most[MOST_WALLS // 4])] = True
    with pytest.raises(ValueError, match=f"{MOST_WALLS + 4} walls around them, allowed are {MOST_WALLS}"):
        borders(cells)
