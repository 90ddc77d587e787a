"""A depth camera's scan as points (KnightRiders, 4.1): beams that show nothing, the sliding median, coordinates.

Scans are rows, (n, beams), m, from right to left; 0 or NaN shows nothing. Points count from the camera, which is at
the nose: ahead and to the left, m. Rows are independent.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from lanekeep_baselines.policy import Floats

#: The report's median takes this many values.
WIDTH = 41


def beam_step(beams: int, field_of_view: float) -> float:
    """Return the angle between neighbouring beams, rad: the report prints it inverted."""
    return field_of_view / (beams - 1)


def filled(ranges: ArrayLike, farthest: float) -> Floats:
    """Return the ranges with the largest one, m, where a beam shows nothing (the report's "NaN to maximum")."""
    shown = np.asarray(ranges, dtype=np.float64)
    return np.where(shown > 0.0, np.minimum(shown, farthest), farthest)


def bridged(ranges: ArrayLike, farthest: float, gap: int) -> Floats:
    """Return the ranges with up to ``gap`` lost beams in a row as their neighbours say, the largest in longer rows.

    Between neighbours the inverse of the range is linear, which it is on a straight wall as far as the angle's cosine
    is 1; at a rim up to twice ``gap`` beams are the nearest that shows something.
    """
    shown = np.asarray(ranges, dtype=np.float64)
    known = (shown > 0.0) & (shown <= farthest)
    beams = np.arange(shown.shape[1])
    before = np.maximum.accumulate(np.where(known, beams, -1), axis=1)
    after = np.minimum.accumulate(np.where(known, beams, len(beams))[:, ::-1], axis=1)[:, ::-1]
    lost, at_rim = after - before - 1, (before < 0) | (after == len(beams))
    short = (lost <= np.where(at_rim, 2 * gap, gap)) & (lost < len(beams))
    inverse = 1.0 / np.where(known, shown, farthest)
    right = np.where(before < 0, after, before).clip(0, len(beams) - 1)
    left = np.where(after == len(beams), before, after).clip(0, len(beams) - 1)
    share = (beams - right) / np.maximum(left - right, 1)
    at_right, at_left = (np.take_along_axis(inverse, index, axis=1) for index in (right, left))
    between = 1.0 / (at_right + share * (at_left - at_right))
    return np.where(known, shown, np.where(short, between, farthest))


def median(ranges: ArrayLike, width: int = WIDTH) -> Floats:
    """Return the sliding median over ``width`` beams (odd), the rim's value repeated beyond the rim.

    So the rim is kept; a window cut off at the rim would erase what only the outermost beams show, up to a quarter of
    the width (10 of 41). Elsewhere what up to half the width (20 of 41) shows vanishes, openings like obstacles.
    """
    shown = np.asarray(ranges, dtype=np.float64)
    half = width // 2
    edged = np.pad(shown, ((0, 0), (half, half)), mode="edge")
    return np.partition(sliding_window_view(edged, 2 * half + 1, axis=1), half, axis=2)[..., half]


def points(ranges: ArrayLike, first_angle: float, step: float) -> Floats:
    """Return the points, (n, beams, 2), of beams ``step`` rad apart to the left, the first at ``first_angle`` rad."""
    shown = np.asarray(ranges, dtype=np.float64)
    angles = first_angle + step * np.arange(shown.shape[1])
    return np.stack([shown * np.cos(angles), shown * np.sin(angles)], axis=2)
