"""A smooth road through given points.

Points are resampled evenly, smoothed in the Fourier domain as strongly as `SMOOTHING_ERROR` allows
(Whittaker's filter: squared deviation plus a penalty on third differences, which punishes changes of
curvature), differentiated there, and cut into segments of linear curvature whose turns are exactly those
of the smooth curve. A loop is closed by the smallest change of the curvatures that does it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lanekeep_env.roads.road import Floats, Road, fitted

#: A road that misses a given point by more is refused, m.
LARGEST_FIT_ERROR = 0.1
#: Deviation that the smoothing may use up, m.
SMOOTHING_ERROR = 0.04
#: Length of the segments, m.
SEGMENT = 3.0
#: Length of an open line's mirrored continuation at both ends, m.
MARGIN = 60.0
#: Most evenly spaced points that a line is smoothed at, twice as many as given and at most 1 m apart: some seconds.
MOST_SAMPLES = 300_000
#: A segment that turns by more, rad, belongs to no road: the points do not follow one another.
MOST_TURN_OF_FIT = 10.0


def fit_centre_line(name: str, points: Floats, closed: bool) -> Road:
    """Return the road through ``points`` (n, 2), m; raises ValueError where they make no road.

    The road's `fit_error` is the largest distance of a given point from it.
    """
    if closed and np.hypot(*(points[-1] - points[0])) < 1e-6:
        points = points[:-1]
    line = points if closed else _with_margins(points)
    chord = np.hypot(*np.diff(np.vstack([line, line[:1]]) if closed else line, axis=0).T)
    station = np.concatenate([[0.0], np.cumsum(chord)])
    first = 0 if closed else (len(line) - len(points)) // 2
    begin, end = station[first], station[first + len(points) - (not closed)]
    if end - begin < 10 * SEGMENT:
        raise ValueError(f"the line is {end - begin:.1f} m long; at least {10 * SEGMENT:.0f} m are needed")
    if end - begin > MOST_SAMPLES * _step(chord):
        raise ValueError(
            f"the line is {end - begin:.6g} m long, allowed are {MOST_SAMPLES * _step(chord):.6g} m where points are "
            f"{float(np.median(chord)):.3g} m apart (median): give fewer points or a shorter line"
        )
    # What overflows or divides by zero is told by the checks of the road.
    with np.errstate(all="ignore"):
        curve = _smoothed(_resampled(line, station, closed), station[-1], closed, begin, end)
        road = _checked(_cut(name, curve, closed))
        if closed:
            road = _close(road)
        scale = road.length / (end - begin)
        along = scale * (station[first : first + len(points)] - begin)
        return replace(road, fit_error=float(_distances(road, points, along).max()), given=points)


def _checked(road: Road) -> Road:
    turn = float((np.maximum(np.abs(road.curvature_start), np.abs(road.curvature_end)) * road.lengths).max())
    if turn > MOST_TURN_OF_FIT:
        raise ValueError(
            f"the line turns by {turn:.3g} rad on {SEGMENT:g} m, allowed are {MOST_TURN_OF_FIT:g} rad; "
            f"points in such an order do not define a road"
        )
    return road


def _with_margins(points: Floats) -> Floats:
    """Continue an open line beyond both ends by its own mirror image, which carries the curvature on."""
    start, end = _mirrored(points[::-1])[::-1], _mirrored(points)
    count = min(len(start), len(end))
    return np.vstack([start[len(start) - count :], points, end[:count]])


def _mirrored(points: Floats) -> Floats:
    """Up to `MARGIN` m of points before the end, newest first, mirrored at the normal through it."""
    back = points[::-1]
    chord = np.hypot(*np.diff(back, axis=0).T)
    count = int(np.clip(np.searchsorted(np.cumsum(chord), MARGIN) + 1, 2, len(points) // 2))
    slope = np.diff(back[:3], axis=0) / chord[:2, None]
    tangent = 2.0 * slope[0] - (slope[0] * chord[1] + slope[1] * chord[0]) / (chord[0] + chord[1])
    tangent /= np.hypot(*tangent)
    offset = back[1 : count + 1] - back[0]
    return back[1 : count + 1] - 2.0 * (offset @ tangent)[:, None] * tangent


def _step(gap: Floats) -> float:
    return min(1.0, float(np.median(gap)) / 2)


def _resampled(line: Floats, station: Floats, closed: bool) -> Floats:
    """Evenly spaced points, at most 1 m apart, on the cubic whose slopes are those of three-point parabolas."""
    gap = np.diff(station)[:, None]
    knots = np.vstack([line, line[:1]]) if closed else line
    slope = np.diff(knots, axis=0) / gap
    if closed:
        before, width = np.roll(slope, 1, axis=0), np.roll(gap, 1, axis=0)
        inner = (before * gap + slope * width) / (gap + width)
        tangent = np.vstack([inner, inner[:1]])
    else:
        inner = (slope[:-1] * gap[1:] + slope[1:] * gap[:-1]) / (gap[1:] + gap[:-1])
        tangent = np.vstack([2 * slope[:1] - inner[:1], inner, 2 * slope[-1:] - inner[-1:]])
    count = max(64, int(np.ceil(station[-1] / _step(gap))))
    at = np.linspace(0.0, station[-1], count + 1)[: count + (not closed)]
    k = np.clip(np.searchsorted(station, at, side="right") - 1, 0, len(gap) - 1)
    t, width = (at - station[k])[:, None] / gap[k], gap[k]
    return (
        (1 + 2 * t) * (1 - t) ** 2 * knots[k]
        + t * (1 - t) ** 2 * width * tangent[k]
        + t**2 * (3 - 2 * t) * knots[k + 1]
        + t**2 * (t - 1) * width * tangent[k + 1]
    )


@dataclass(frozen=True)
class _Curve:
    """Samples of a smooth curve: position, arc length, heading and curvature at each."""

    position: Floats
    station: Floats
    heading: Floats
    curvature: Floats


def _smoothed(samples: Floats, total: float, closed: bool, begin: float, end: float) -> _Curve:
    """Smooth evenly spaced samples over ``total`` m and return the curve from ``begin`` to ``end``."""
    n = len(samples)
    step = total / (n - (not closed))
    # An open line minus the chord between its ends, continued as an odd function, is periodic.
    trend = np.zeros_like(samples) if closed else np.linspace(samples[0], samples[-1], n)
    rise = np.zeros(2) if closed else (samples[-1] - samples[0]) / total
    wave = samples - trend
    periodic = wave if closed else np.vstack([wave, -wave[-2:0:-1]])
    spectrum = np.fft.rfft(periodic, axis=0)
    angle = 2.0 * np.pi * np.fft.rfftfreq(len(periodic))[:, None]
    penalty = (2.0 - 2.0 * np.cos(angle)) ** 3
    inside = slice(0, n) if closed else slice(round(begin / step), round(end / step) + 1)

    def filtered(strength: float, derivative: int = 0) -> Floats:
        weight = (1j * angle / step) ** derivative / (1.0 + strength * penalty)
        return np.fft.irfft(spectrum * weight, n=len(periodic), axis=0)[:n]

    low, high = -2.0, 14.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        deviation = np.hypot(*(filtered(10.0**middle) - wave)[inside].T).max()
        low, high = (middle, high) if deviation < SMOOTHING_ERROR else (low, middle)
    strength = 10.0**low
    position = filtered(strength) + trend
    first, second = filtered(strength, 1) + rise, filtered(strength, 2)
    if closed:
        position, first, second = (np.vstack([a, a[:1]]) for a in (position, first, second))
        inside = slice(0, n + 1)
    position, first, second = position[inside], first[inside], second[inside]
    pace = np.hypot(*first.T)
    heading = np.unwrap(np.arctan2(first[:, 1], first[:, 0]))
    station = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * step)])
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / pace**3
    return _Curve(position, station, heading, curvature)


def _cut(name: str, curve: _Curve, closed: bool) -> Road:
    """Cut a curve into segments of about `SEGMENT` m."""
    pieces = max(4, round(curve.station[-1] / SEGMENT))
    at = np.round(np.linspace(0, len(curve.station) - 1, pieces + 1)).astype(np.intp)
    heading = curve.heading[at]
    if closed:
        heading[-1] = heading[0] + 2.0 * np.pi * round((heading[-1] - heading[0]) / (2.0 * np.pi))
    road = fitted(name, curve.station[at], curve.curvature[at], heading)
    x, y = curve.position[0]
    return replace(road, closed=closed, origin=(float(x), float(y), float(heading[0])))


def _close(road: Road) -> Road:
    """Close a loop in position and heading by the least change of the segments' curvatures (Newton, minimum norm)."""
    turns = 2.0 * np.pi * round((road.headings[-1] - road.headings[0]) / (2.0 * np.pi))
    for _ in range(20):
        points = road.points
        gap = points[0] - points[-1]
        excess = turns - (road.headings[-1] - road.headings[0])
        if np.hypot(*gap) < 1e-9 and abs(excess) < 1e-12:
            return road
        # A turn c h of a segment swings all that follows round the segment's middle.
        arm = points[-1] - 0.5 * (points[1:] + points[:-1])
        effect = road.lengths * np.stack([np.ones(len(arm)), -arm[:, 1], arm[:, 0]])
        weighted = effect / road.lengths
        change = weighted.T @ np.linalg.solve(effect @ weighted.T, np.array([excess, *gap]))
        road = _checked(
            replace(road, curvature_start=road.curvature_start + change, curvature_end=road.curvature_end + change)
        )
    raise ValueError(f"the loop does not close: {np.hypot(*gap):.2g} m and {excess:.2g} rad are left")


def _distances(road: Road, points: Floats, along: Floats) -> Floats:
    """Distance of each point from the road, m; ``along`` is a first guess of its arc length."""
    s = along.copy()
    for _ in range(8):
        heading = road.heading(s)
        offset = points - road.position(s)
        ahead = np.cos(heading) * offset[:, 0] + np.sin(heading) * offset[:, 1]
        s = s + np.clip(ahead, -2.0, 2.0)
        if not road.closed:
            s = np.clip(s, 0.0, road.length)
    return np.hypot(*(points - road.position(s)).T)
