"""A road through given points exactly: one clothoid from each to the next, its curvature running on at the points.

It is the spline of clothoids; between points that lie on straights, arcs and clothoids it is that line. Where the
curvature of the line jumps it would swing, so jumps are found first: an interval whose points before it, and those
behind it, each lie on a clothoid of their own, gets a point where the two touch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lanekeep_env.roads.road import Floats, Road, chords

#: Largest angle between successive chords, rad: points in such an order do not follow one another.
SHARPEST = 2.0
# Corrections of the headings, and sweeps of each: a sweep at least halves what is left.
_CORRECTIONS, _SWEEPS = 12, 45
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_PLACE, _SHARE = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


def through(name: str, points: Floats, closed: bool) -> Road:
    """Return the road through ``points`` (n, 2), m; ValueError where they do not follow one another."""
    line = _Line(points, closed)
    sharpest = int(np.argmax(np.abs(line.bend)))
    if abs(line.bend[sharpest]) > SHARPEST:
        raise ValueError(
            f"the line turns by {abs(line.bend[sharpest]):.3g} rad at its point {sharpest + 1}, allowed are "
            f"{SHARPEST:g} rad; points in such an order do not define a road"
        )
    behind, ahead = _sides(line)
    fixed = np.full(len(points), np.nan)
    if not closed:
        fixed[0], fixed[-1] = ahead.heading[0], behind.heading[-1]
    points, fixed = _with_jumps(line, (behind, ahead), fixed)
    lengths, start, end, heading = _solved(_Line(points, closed), fixed)
    return Road(name, lengths, start, end, closed=closed, origin=(float(points[0, 0]), float(points[0, 1]), heading))


class _Line:
    """Chords of a line of points: length, direction, and how far each point turns from one to the next."""

    def __init__(self, points: Floats, closed: bool) -> None:
        self.points, self.closed = points, closed
        step = np.diff(np.vstack([points, points[:1]]) if closed else points, axis=0)
        self.chord, self.direction = np.hypot(*step.T), np.arctan2(step[:, 1], step[:, 0])
        turn = np.diff(self.direction, prepend=self.direction[-1] if closed else self.direction[0])
        #: At each point that has a chord behind it.
        self.bend = np.arctan2(np.sin(turn), np.cos(turn))


def _clothoids(chord: Floats, before: Floats, after: Floats) -> tuple[Floats, Floats, Floats]:
    """Lengths and end curvatures of the clothoids over chords, of which the heading at both ends is given (Newton).

    ``before`` and ``after`` are the headings minus the chord's direction, rad (Bertolazzi, Frego 2015).
    """
    rise = after - before
    bow = 3.0 * (before + after)
    for _ in range(5):
        angle = before[:, None] + (rise - bow)[:, None] * _PLACE + bow[:, None] * _PLACE**2
        sine, cosine = np.sin(angle) @ _SHARE, np.cos(angle) @ (_SHARE * (_PLACE**2 - _PLACE))
        bow = bow - sine / np.where(cosine == 0.0, 1.0, cosine)
    angle = before[:, None] + (rise - bow)[:, None] * _PLACE + bow[:, None] * _PLACE**2
    length = chord / np.maximum(np.cos(angle) @ _SHARE, 0.05)
    return length, (rise - bow) / length, (rise + bow) / length


def _solved(line: _Line, fixed: Floats) -> tuple[Floats, Floats, Floats, float]:
    """Segments through all points, their curvature running on but where the heading is ``fixed`` (rad, or NaN)."""
    c, n, closed = line.chord, len(line.points), line.closed
    direction = line.direction if closed else np.append(line.direction, line.direction[-1])
    bend = line.bend if closed else np.append(line.bend, 0.0)
    held = np.isfinite(fixed)
    # Heading minus the direction of the chord ahead of the point; at first that of a circle through three points.
    ahead = c if closed else np.append(c, c[-1])
    behind = np.roll(c, 1) if closed else np.concatenate([c[:1], c])
    a = -bend * ahead / (ahead + behind)
    a[held] = np.arctan2(np.sin(fixed - direction), np.cos(fixed - direction))[held]
    diagonal = 4.0 / ahead + 4.0 / behind
    for _ in range(_CORRECTIONS):
        after = np.roll(a, -1) + np.roll(bend, -1)
        length, start, end = _clothoids(c, a[: len(c)], after[: len(c)])
        apart = start - np.roll(end, 1) if closed else np.concatenate([[0.0], start[1:] - end[:-1], [0.0]])
        apart[held] = 0.0
        if np.abs(apart * np.minimum(ahead, behind)).max() < 1e-12:
            break
        change = np.zeros(n)
        for _ in range(_SWEEPS):
            change = (apart - 2.0 / behind * np.roll(change, 1) - 2.0 / ahead * np.roll(change, -1)) / diagonal
            change[held] = 0.0
        a = a + change
    return length, start, end, float(direction[0] + a[0])


@dataclass(frozen=True)
class _Side:
    """What the points up to each point say of the line there, or those from it on: as if it were one clothoid.

    Attributes:
        heading, curvature, slope: rad, 1/m, 1/m², (n,); NaN where there are too few points.
        doubt: how far one more point misses that clothoid's curvature, 1/m.
    """

    heading: Floats
    curvature: Floats
    slope: Floats
    doubt: Floats


def _sides(line: _Line) -> tuple[_Side, _Side]:
    """What the points up to each one say, and what those from it on say."""
    points = line.points
    if line.closed:
        pad = min(_REACH, len(points))
        points = np.vstack([points[-pad:], points, points[:pad]])
    inner = slice(pad, -pad) if line.closed else slice(None)
    behind = _side(points)
    # Backwards the line bends the other way, and its slope is the same.
    ahead = _side(points[::-1])
    sides = (behind, (ahead[0][::-1] + np.pi, -ahead[1][::-1], ahead[2][::-1], ahead[3][::-1]))
    first, second = (_Side(*(values[inner] for values in side)) for side in sides)
    return first, second


_REACH = 6


def _side(points: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Heading, curvature, slope and doubt at each point from the points up to it."""
    n = len(points)
    step = np.diff(points, axis=0)
    c, direction = np.hypot(*step.T), np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    bend, wide = np.full(n, np.nan), np.full(n, np.nan)
    wide[1:-1] = np.hypot(*(points[2:] - points[:-2]).T)
    bend[1:-1] = 2.0 * np.sin(np.diff(direction)) / np.maximum(wide[1:-1], 1e-12)  # of the circle through three points
    turned = np.append(np.nan, c) * np.where(np.isfinite(bend), bend, 0.0)
    arc = np.append(np.nan, c) * (1.0 + np.minimum(turned, 1.0) ** 2 / 24.0)
    station = np.concatenate([[0.0], np.cumsum(arc[1:])])
    place = np.full(n, np.nan)  # where that is the curvature
    place[1:-1] = (station[:-2] + station[1:-1] + station[2:]) / 3.0
    one, two, three = (_later(bend, k) for k in (1, 2, 3))
    at_one, at_two, at_three = (_later(place, k) for k in (1, 2, 3))
    slope = (one - two) / (at_one - at_two)
    curvature = one + slope * (station - at_one)
    half = 0.5 * arc
    heading = np.append(np.nan, direction) + (curvature - slope * half) * half + slope * arc**2 / 12.0
    return heading, curvature, slope, np.abs(three - (one + slope * (at_three - at_one)))


def _later(values: Floats, steps: int) -> Floats:
    return np.concatenate([np.full(steps, np.nan), values[:-steps]])


#: A jump of curvature is that many times what a third point misses on either side, and this share of the sharpest bend.
_CLEAR, _SMALLEST = 8.0, 0.02
#: A jump nearer to a point than this share of the interval takes the point's place; it may seem to lie so far outside.
_AT_POINT = 0.02


def _with_jumps(line: _Line, sides: tuple[_Side, _Side], fixed: Floats) -> tuple[Floats, Floats]:
    """Points and fixed headings, with points more where the curvature jumps."""
    n, closed = len(line.points), line.closed
    first = np.arange(n if closed else n - 1)
    last = (first + 1) % n
    (behind, ahead), c = sides, line.chord
    k0, k1, m0, m1 = behind.curvature[first], ahead.curvature[last], behind.slope[first], ahead.slope[last]
    length = c * (1.0 + (np.maximum(np.abs(k0), np.abs(k1)) * c) ** 2 / 48.0)
    apart = ahead.heading[last] - behind.heading[first]
    apart = np.arctan2(np.sin(apart), np.cos(apart))
    with np.errstate(all="ignore"):
        u = 0.5 * length
        for _ in range(6):
            left = length - u
            miss = k0 * u + 0.5 * m0 * u**2 + k1 * left - 0.5 * m1 * left**2 - apart
            u = np.clip(u - miss / (k0 + m0 * u - k1 + m1 * left), -length, 2.0 * length)
        jump = np.abs(k0 + m0 * u - k1 + m1 * (length - u))
        doubt = np.maximum(behind.doubt[first], ahead.doubt[last])
        clear = (jump > _CLEAR * doubt) & (u > -_AT_POINT * length) & (u < (1.0 + _AT_POINT) * length)
        sharpest = np.nanmax(np.abs(np.concatenate([k0, k1])), initial=0.0)
        clear &= jump > _SMALLEST * sharpest
    found = np.flatnonzero(clear)
    if not len(found):
        return line.points, fixed
    u = np.clip(u[found], 0.0, length[found])
    left = length[found] - u
    begin, end = line.points[first[found]], line.points[last[found]]
    from_begin = begin + chords(behind.heading[first[found]], k0[found], m0[found], u)
    from_end = end - chords(
        ahead.heading[last[found]] - k1[found] * left + 0.5 * m1[found] * left**2,
        k1[found] - m1[found] * left,
        m1[found],
        left,
    )
    gap = np.hypot(*(from_end - from_begin).T)
    good = gap < _TOUCHING * jump[found] * length[found] ** 2
    heading = behind.heading[first[found]] + k0[found] * u + 0.5 * m0[found] * u**2
    points, fixed = line.points.copy(), fixed.copy()
    share, place = u / (u + left), 0.5 * (from_begin + from_end)
    for at, where in ((first, good & (share <= _AT_POINT)), (last, good & (share >= 1.0 - _AT_POINT))):
        points[at[found[where]]], fixed[at[found[where]]] = place[where], heading[where]
    inner = good & (share > _AT_POINT) & (share < 1.0 - _AT_POINT)
    behind_of = found[inner] + 1
    return np.insert(points, behind_of, place[inner], axis=0), np.insert(fixed, behind_of, heading[inner])


#: How near the clothoids of both sides come where they are parallel, as a share of jump times length².
_TOUCHING = 0.02
