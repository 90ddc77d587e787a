"""A smooth road through points that scatter.

Points are resampled evenly, smoothed in the Fourier domain (Whittaker's filter: squared deviation plus a penalty on
third differences, which punishes changes of curvature) until they are as far off as they scatter, differentiated
there, and cut into segments of linear curvature whose turns are exactly those of the smooth curve. A loop is closed by
the smallest change of the curvatures that does it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.roads.road import Floats, Road, fitted

#: Longest segments, m; they turn by less than `_TURN` rad at the sharpest bends.
SEGMENT, _TURN = 3.0, 0.25
#: No point is left by more than that many times the scatter, and so many metres more: bends keep their place.
_OFF_MOST, _OFF_ALWAYS = 3.5, 0.02
#: Length of an open line's mirrored continuation at both ends, m.
MARGIN = 500.0
#: Over how much of the line, m and points at least, its direction there is taken.
_END, _END_POINTS = 60.0, 7
#: Most evenly spaced points that a line is smoothed at, twice as many as given and at most 1 m apart: some seconds.
MOST_SAMPLES = 300_000
#: A segment that turns by more, rad, belongs to no road: the points do not follow one another.
MOST_TURN_OF_FIT = 10.0


@dataclass(frozen=True)
class Smoothed:
    """A smooth road, and what smoothing costs.

    Attributes:
        road: the road.
        shortest: waves shorter than that are more than halved, m.
        doubt: standard deviation of the curvature that the scatter leaves, 1/m.
    """

    road: Road
    shortest: float
    doubt: float


def smoothed(name: str, points: Floats, closed: bool, scatter: float, off: float, sharpest: float) -> Smoothed:
    """Return the road through ``points`` (n, 2), m, that scatter; ValueError where they make no road.

    Args:
        name: the road's.
        points: m, (n, 2).
        closed: whether the last point leads back to the first.
        scatter: standard deviation of the points in each direction, m.
        off: by how much the road may leave them, likewise, m; more than they scatter makes it smoother than it was.
        sharpest: curvature that is hardly exceeded, 1/m; segments are so short that they follow it.
    """
    line = points if closed else _with_margins(points, min(_END, 1.0 / max(sharpest, 1e-9)))
    chord = np.hypot(*np.diff(np.vstack([line, line[:1]]) if closed else line, axis=0).T)
    station = np.concatenate([[0.0], np.cumsum(chord)])
    first = 0 if closed else (len(line) - len(points)) // 2
    here = station[first : first + len(points)]
    end = station[-1] if closed else here[-1]
    # What overflows or divides by zero is told by the checks of the road.
    with np.errstate(all="ignore"):
        samples, inside, step = _resampled(line, station, closed, float(here[0]), float(end))
        at = np.round((here - here[0]) / step).astype(np.intp) + inside.start
        curve, cutoff = _filtered(samples, step, closed, inside, np.minimum(at, len(samples) - 1), off)
        road = _checked(_cut(name, curve, closed, min(SEGMENT, _TURN / max(sharpest, 1e-9))))
        if closed:
            road = close(road)
    doubt = scatter * np.sqrt(float(np.median(chord)) * cutoff**5 / 18.0)
    return Smoothed(road, float(2.0 * np.pi / cutoff), float(doubt))


def _checked(road: Road) -> Road:
    turn = float((np.maximum(np.abs(road.curvature_start), np.abs(road.curvature_end)) * road.lengths).max())
    if turn > MOST_TURN_OF_FIT:
        raise ValueError(
            f"the line turns by {turn:.3g} rad within {road.lengths.max():.3g} m, allowed are {MOST_TURN_OF_FIT:g} "
            f"rad; points in such an order do not define a road"
        )
    return road


def _with_margins(points: Floats, straight: float) -> Floats:
    """Continue an open line beyond both ends by its own mirror image, which carries the curvature on."""
    start, end = _mirrored(points[::-1], straight)[::-1], _mirrored(points, straight)
    count = min(len(start), len(end))
    return np.vstack([start[len(start) - count :], points, end[:count]])


def _mirrored(points: Floats, straight: float) -> Floats:
    """Up to `MARGIN` m of points before the end, newest first, mirrored at the normal through it.

    The direction at the end is that of the cubic through the last ``straight`` m: of few points it would scatter.
    """
    back = points[::-1]
    chord = np.hypot(*np.diff(back, axis=0).T)
    count = int(np.clip(np.searchsorted(np.cumsum(chord), MARGIN) + 1, 2, len(points) - 1))
    far = np.concatenate([[0.0], np.cumsum(chord)])
    near = int(np.clip(np.searchsorted(far, straight), min(_END_POINTS, len(back)), 100))
    tangent = np.linalg.lstsq(np.vander(far[:near] / far[near - 1], 4), back[:near] - back[0], rcond=None)[0][2]
    tangent /= np.hypot(*tangent)
    offset = back[1 : count + 1] - back[0]
    return back[1 : count + 1] - 2.0 * (offset @ tangent)[:, None] * tangent


def sample_step(gap: Floats) -> float:
    """Distance of the evenly spaced points, m, where points are ``gap`` apart."""
    return min(1.0, float(np.median(gap)) / 2)


def _resampled(line: Floats, station: Floats, closed: bool, begin: float, end: float) -> tuple[Floats, slice, float]:
    """Evenly spaced points on the cubic whose slopes are those of three-point parabolas.

    They are at most 1 m apart, and one is at ``begin`` and one at ``end``: the slice between these and the distance of
    the points, m, come with them.
    """
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
    count = max(64, int(np.ceil((end - begin) / sample_step(gap))))
    step = (end - begin) / count
    first, after = int(begin / step), -1 if closed else int((float(station[-1]) - end) / step)
    at = np.clip(begin + step * np.arange(float(-first), count + after + 1), 0.0, station[-1])
    k = np.clip(np.searchsorted(station, at, side="right") - 1, 0, len(gap) - 1)
    t, width = (at - station[k])[:, None] / gap[k], gap[k]
    samples = (
        (1 + 2 * t) * (1 - t) ** 2 * knots[k]
        + t * (1 - t) ** 2 * width * tangent[k]
        + t**2 * (3 - 2 * t) * knots[k + 1]
        + t**2 * (t - 1) * width * tangent[k + 1]
    )
    return samples, slice(first, first + count + (not closed)), step


@dataclass(frozen=True)
class _Curve:
    """Samples of a smooth curve: position, arc length, heading and curvature at each."""

    position: Floats
    station: Floats
    heading: Floats
    curvature: Floats


def _filtered(
    samples: Floats, step: float, closed: bool, inside: slice, at: NDArray[np.intp], most: float
) -> tuple[_Curve, float]:
    """Smooth samples ``step`` m apart; return the curve ``inside``, and the filter's cutoff.

    The samples ``at`` the given points are off by ``most`` on average afterwards. The cutoff, rad/m, is where a wave
    is halved.
    """
    n = len(samples)
    # An open line minus the chord between its ends, continued as an odd function, is periodic.
    trend = np.zeros_like(samples) if closed else np.linspace(samples[0], samples[-1], n)
    rise = np.zeros(2) if closed else (samples[-1] - samples[0]) / (step * (n - 1))
    wave = samples - trend
    periodic = wave if closed else np.vstack([wave, -wave[-2:0:-1]])
    spectrum = np.fft.rfft(periodic, axis=0)
    angle = 2.0 * np.pi * np.fft.rfftfreq(len(periodic))[:, None]
    penalty = (2.0 - 2.0 * np.cos(angle)) ** 3

    def filtered(strength: float, derivative: int = 0) -> Floats:
        weight = (1j * angle / step) ** derivative / (1.0 + strength * penalty)
        return np.fft.irfft(spectrum * weight, n=len(periodic), axis=0)[:n]

    low, high = -2.0, 16.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        off = np.hypot(*(filtered(10.0**middle) - wave)[at].T)
        kept = np.sqrt(0.5 * np.mean(off**2)) < most and off.max() < _OFF_MOST * most + _OFF_ALWAYS
        low, high = (middle, high) if kept else (low, middle)
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
    cutoff = 2.0 * np.arcsin(min(1.0, 0.5 * strength ** (-1.0 / 6.0))) / step
    return _Curve(position, station, heading, curvature), float(cutoff)


def _cut(name: str, curve: _Curve, closed: bool, segment: float) -> Road:
    """Cut a curve into segments of about ``segment`` m."""
    pieces = min(len(curve.station) - 1, max(4, round(curve.station[-1] / segment)))
    at = np.round(np.linspace(0, len(curve.station) - 1, pieces + 1)).astype(np.intp)
    heading = curve.heading[at]
    if closed:
        heading[-1] = heading[0] + 2.0 * np.pi * round((heading[-1] - heading[0]) / (2.0 * np.pi))
    road = fitted(name, curve.station[at], curve.curvature[at], heading)
    x, y = curve.position[0]
    return replace(road, closed=closed, origin=(float(x), float(y), float(heading[0])))


def close(road: Road) -> Road:
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
        try:
            change = weighted.T @ np.linalg.solve(effect @ weighted.T, np.array([excess, *gap]))
        except np.linalg.LinAlgError:
            break
        road = _checked(
            replace(road, curvature_start=road.curvature_start + change, curvature_end=road.curvature_end + change)
        )
    raise ValueError(f"the loop does not close: {np.hypot(*gap):.2g} m and {excess:.2g} rad are left")
