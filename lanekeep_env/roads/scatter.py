"""How clean points are: duplicates, straights that are given by their ends, and how far points scatter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.roads.road import Floats

#: Points nearer to each other are one, m.
SAME = 1e-6
_WINDOW = 7
#: A chord is looked at if it is that many times a neighbour's length ...
_LONG = 2.5
#: ... an arc beside it would bow by more than the first, m, if it went on along the chord, and the chord bends by less
#: than this share of that arc, or bows by less than the last, m.
_BOWED, _STRAIGHT, _BOW = 0.02, 0.2, 0.0003
_MOST_ADDED = 200


def without_twins(points: Floats, closed: bool) -> NDArray[np.intp]:
    """Return the indices of points that differ from the one before, and of a loop's last if it is not its first."""
    kept = np.flatnonzero(np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) >= SAME]))
    if closed and len(kept) > 1 and np.hypot(*(points[kept[-1]] - points[0])) < SAME:
        kept = kept[:-1]
    return kept


def scatter_of(points: Floats, closed: bool) -> float:
    """Return how far points scatter across their line, a standard deviation in m.

    Sixth divided differences over seven points: a smooth line all but vanishes in them, and they are taken as their
    median, so that jumps of curvature do not count.
    """
    if closed:
        points = np.vstack([points, points[: _WINDOW - 1]])
    n = len(points) - _WINDOW + 1
    if n < 1:
        return 0.0
    station = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    s = np.stack([station[k : k + n] for k in range(_WINDOW)], axis=1)
    s = s / (s[:, -1:] - s[:, :1])
    apart = s[:, :, None] - s[:, None, :] + np.eye(_WINDOW)
    weight = 1.0 / apart.prod(axis=2)
    weight /= np.sqrt((weight**2).sum(axis=1, keepdims=True))
    along = points[_WINDOW - 1 :] - points[:n]
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    window = np.stack([points[k : k + n] for k in range(_WINDOW)], axis=1) - points[:n, None, :]
    off = (weight * (window @ normal[:, :, None])[:, :, 0]).sum(axis=1)
    return float(np.median(np.abs(off)) / 0.6745)


def with_straights(points: Floats, closed: bool) -> Floats:
    """Return the points with more on straights that are given by their ends: a smooth line through those would bow.

    A chord much longer than one beside it is a straight where the turns at its ends are those of the short neighbours
    alone, and not of an arc that goes on along it.
    """
    step = np.diff(np.vstack([points, points[:1]]) if closed else points, axis=0)
    c, direction = np.hypot(*step.T), np.arctan2(step[:, 1], step[:, 0])
    turn = np.diff(direction, append=direction[:1])  # at the end of each chord
    turn = np.arctan2(np.sin(turn), np.cos(turn))
    if not closed:
        turn[-1] = 0.0
    after, before = np.roll(c, -1), np.roll(c, 1)
    further, earlier = np.roll(turn, -1), np.roll(turn, 2)
    far, near = np.roll(c, -2), np.roll(c, 2)
    at_end, curved_end = _straight_like(c, turn, after, further, far)
    at_begin, curved_begin = _straight_like(c, np.roll(turn, 1), before, earlier, near)
    if not closed:
        after[-1] = before[0] = np.inf
        at_end[-1] = at_begin[0] = True
        curved_end[-1] = curved_begin[0] = False
    shorter = np.minimum(before, after)
    chosen = np.flatnonzero((curved_end | curved_begin) & at_end & at_begin)
    count = np.minimum(np.ceil(c[chosen] / shorter[chosen]), _MOST_ADDED).astype(np.intp) - 1
    where = np.repeat(chosen + 1, count)
    share = np.concatenate([np.arange(1, k + 1) / (k + 1) for k in count]) if len(count) else np.zeros(0)
    begin = np.repeat(chosen, count)
    return np.insert(points, where, points[begin] + share[:, None] * step[begin], axis=0)


def _straight_like(
    c: Floats, turn: Floats, beside: Floats, further: Floats, far: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether chords look straight from one end, and whether an arc is there that a smooth line would go on along.

    Given are the turns at that end and one chord on, and the lengths of the next two chords.
    """
    long = c > _LONG * beside
    arc = 2.0 * further / (beside + far)
    bend = np.abs(np.where(long, (2.0 * turn - arc * beside) / c, 2.0 * turn / (c + beside)))
    curved = long & (np.abs(arc) * c**2 / 8.0 > _BOWED)
    return (curved & (bend < _STRAIGHT * np.abs(arc))) | (bend * c**2 / 8.0 < _BOW), curved
