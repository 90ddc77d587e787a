"""Where cars are along a centre line."""

from __future__ import annotations

import numpy as np

from lanekeep_env.compile import helper


@helper
def locate(x, y, line, first, count, closed, begin, end):
    """Return (segment, station, lateral, cosine, sine) of the nearest place on segments begin..end-1 of a line.

    Segments count from the line's first point and wrap round a closed line; lateral is positive to the left.
    """
    best, found = np.inf, np.int64(0)
    station = lateral = 0.0
    cosine, sine = 1.0, 0.0
    segments = count - 1
    for k in range(begin, end):
        segment = k
        if closed:
            segment = k % segments
        elif k < 0 or k >= segments:
            continue
        a = first + segment
        ex, ey = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
        length = np.sqrt(ex * ex + ey * ey)
        ex, ey = ex / length, ey / length
        dx, dy = x - line[0, a], y - line[1, a]
        along = min(max(dx * ex + dy * ey, 0.0), length)
        ox, oy = dx - along * ex, dy - along * ey
        distance = ox * ox + oy * oy
        if distance < best:
            best, found = distance, segment
            station, lateral = line[2, a] + along, ex * dy - ey * dx
            cosine, sine = ex, ey
    return found, station, lateral, cosine, sine


@helper
def follow(x, y, line, first, count, closed, segment):
    """`locate` near the segment where a car was last; further off as long as it is nearest at the search's edge."""
    reach = np.int64(8)
    found, station, lateral, cosine, sine = locate(
        x, y, line, first, count, closed, segment - reach, segment + reach + 1
    )
    while reach < count:
        if closed:
            moved = (found - segment) % (count - 1)
            moved = min(moved, count - 1 - moved)
        else:
            moved = abs(found - segment)
        if moved < reach:
            break
        reach *= 2
        found, station, lateral, cosine, sine = locate(
            x, y, line, first, count, closed, segment - reach, segment + reach + 1
        )
    return found, station, lateral, cosine, sine
