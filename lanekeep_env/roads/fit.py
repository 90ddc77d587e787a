"""A road through given points: exactly where they are clean, smoothed where they scatter, or a refusal.

Points are clean if what they scatter does not matter to the curvature of a line through them; see `spline`. Otherwise
they are smoothed (see `smooth`) as far as they scatter, by themselves only where little curvature is lost in it. Lines
with kinks, which no car drives, may be left by a tolerance instead.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from lanekeep_env.roads.road import Floats, Road
from lanekeep_env.roads.scatter import scatter_of, with_straights, without_twins
from lanekeep_env.roads.smooth import MOST_SAMPLES, Smoothed, sample_step, smoothed
from lanekeep_env.roads.spline import through

#: A road that misses a given point by more is refused unless smoothing is asked for, m.
LARGEST_FIT_ERROR = 0.1
#: Shortest road, m, and tightest radius, m: those of a model car of 1:40.
SHORTEST, TIGHTEST = 3.0, 0.1
#: Curvature that scatter may leave unknown, 1/m, or as a share of what the line has, where nobody asks for smoothing.
_DOUBT, _DOUBT_SHARE = 5e-4, 0.1
#: The same for points that a road leads through exactly.
_CLEAN, _CLEAN_SHARE = 3e-5, 0.01
#: Scatter of rounded coordinates, as a share of the points' distance: smoothed without a warning.
_ROUNDING = 1e-3
#: Smoothing beyond the scatter by oneself, m, and as a share of a tolerance: the farthest points are so much farther.
_SMOOTHER, _SHARE = 0.02, 0.35
_UNITS = "are they in m? Name the columns with their unit (x_km,y_km or x_mm,y_mm), or lat,lon"


def fit_centre_line(
    name: str,
    points: Floats,
    closed: bool,
    smoothing: float | None = None,
    rounding: float = 0.0,
    tolerance: float = 0.0,
) -> Road:
    """Return the road through ``points`` (n, 2), m; raises ValueError where they make no road.

    Args:
        name: the road's.
        points: m, (n, 2).
        closed: whether the last point leads back to the first.
        smoothing: standard deviation by which the points scatter, m; 0 for none, None to estimate it: the road is then
            refused where that leaves its curvature unknown.
        rounding: what they scatter at the least, where it is estimated, m.
        tolerance: by which the road may miss them where nobody asks for smoothing, m, if more than usual.

    The road's `fit_error` is the largest distance of a given point from it.
    """
    kept = without_twins(points, closed)
    line = points[kept]
    chord = np.hypot(*np.diff(np.vstack([line, line[:1]]) if closed else line, axis=0).T)
    _check_size(chord)
    scatter = max(scatter_of(line, closed), rounding) if smoothing is None else smoothing
    sharpest = _sharpest(line, closed)
    spacing = float(np.median(chord))
    told: tuple[str, ...] = () if len(line) == len(points) else (f"{len(points) - len(line)} repeated points left out",)
    if 2.5 * scatter / spacing**2 <= max(_CLEAN, _CLEAN_SHARE * sharpest) or smoothing == 0.0:
        fuller = with_straights(line, closed)
        if len(fuller) > len(line):
            told += ("long chords between short ones are straight",)
        road = through(name, fuller, closed)
    else:
        if smoothing is None:
            found = _smoothed(name, line, closed, scatter, sharpest, tolerance)
            cost = _cost(scatter, found)
            _judge(found, scatter, cost, loud=scatter > _ROUNDING * spacing)
        else:
            found = smoothed(name, line, closed, scatter, scatter, sharpest)
            cost = _cost(scatter, found)
        road, told = found.road, (*told, cost)
    along, apart = _nearest(road, line)
    road = replace(road, fit_error=float(apart.max()), given=line, assumed=told)
    _check_fit(
        road, spacing, scatter, max(LARGEST_FIT_ERROR, tolerance) + 6.0 * (rounding if smoothing is None else smoothing)
    )
    # Points that were left out take the place of their twins.
    twin = np.clip(np.searchsorted(kept, np.arange(len(points)), side="right") - 1, 0, None)
    return replace(road, beside=np.column_stack([along[twin], np.full((len(points), 3), np.nan)]))


def _smoothed(name: str, line: Floats, closed: bool, scatter: float, sharpest: float, tolerance: float) -> Smoothed:
    """Smooth as far as points scatter; more where that leaves the curvature unknown, less where it leaves the points.

    Dense points may be smoothed a little more than they scatter: that costs millimetres, and halves the doubt. With a
    ``tolerance`` it may cost that.
    """
    found, off = smoothed(name, line, closed, scatter, scatter, sharpest), scatter
    while found.doubt > _allowed(found.road) and 2.0 * off <= max(_SMOOTHER, _SHARE * tolerance):
        off *= 2.0
        found = smoothed(name, line, closed, scatter, off, sharpest)
    while tolerance > 0.0 and off > _SHARE * tolerance / 8.0 and _nearest(found.road, line)[1].max() > tolerance:
        off /= 2.0
        less = smoothed(name, line, closed, scatter, off, sharpest)
        if less.doubt > _allowed(less.road):
            break
        found = less
    return found


def _check_size(chord: Floats) -> None:
    length = float(chord.sum())
    if length < SHORTEST:
        raise ValueError(f"the line is {length:.3g} m long; at least {SHORTEST:g} m are needed ({_UNITS})")
    if length > MOST_SAMPLES * sample_step(chord):
        raise ValueError(
            f"the line is {length:.6g} m long, allowed are {MOST_SAMPLES * sample_step(chord):.6g} m where points are "
            f"{float(np.median(chord)):.3g} m apart (median): give fewer points or a shorter line"
        )


def _check_fit(road: Road, spacing: float, scatter: float, allowed: float) -> None:
    """Refuse a road that misses its points by more than ``allowed``, m, or bends more than any."""
    if not road.fit_error <= allowed:
        raise ValueError(
            f"the road misses a point by {road.fit_error:.2f} m, allowed are {allowed:.3g} m; points this rough (they "
            f"scatter by about {scatter:.2g} m) or far apart (median {spacing:.1f} m) do not define a road: give "
            f"cleaner ones, or accept it with smoothing={scatter:.2g} (m, standard deviation)"
        )
    if road.peak_curvature * TIGHTEST > 1.0:
        raise ValueError(
            f"a radius of {1 / road.peak_curvature:.2g} m; allowed are radii from {TIGHTEST:g} m ({_UNITS})"
        )


def _sharpest(line: Floats, closed: bool) -> float:
    """Curvature that one point in twenty exceeds: of circles through three points, some chords from each other."""
    best = np.inf
    for gap in (1, 2, 4):
        if len(line) < 4 * gap:
            continue
        if closed:
            before, middle, after = np.roll(line, gap, axis=0), line, np.roll(line, -gap, axis=0)
        else:
            before, middle, after = line[: -2 * gap], line[gap:-gap], line[2 * gap :]
        a, b = middle - before, after - middle
        area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        sides = np.hypot(*a.T) * np.hypot(*b.T) * np.maximum(np.hypot(*(after - before).T), 1e-12)
        best = min(best, float(np.quantile(2.0 * area / np.maximum(sides, 1e-30), 0.95)))
    return best if np.isfinite(best) else 0.0


def _cost(scatter: float, found: Smoothed) -> str:
    return (
        f"points scatter by {scatter:.2g} m: smoothed, changes of curvature within {found.shortest:.0f} m are "
        f"flattened, curvature is known to {found.doubt:.1g} 1/m"
    )


def _allowed(road: Road) -> float:
    """Curvature that may stay unknown, 1/m."""
    bend = float(np.sqrt(np.average((0.5 * (road.curvature_start + road.curvature_end)) ** 2, weights=road.lengths)))
    return max(_DOUBT, _DOUBT_SHARE * bend)


def _judge(found: Smoothed, scatter: float, cost: str, loud: bool) -> None:
    """Refuse to smooth by oneself where the curvature stays unknown; otherwise say what it costs if it is ``loud``."""
    allowed = _allowed(found.road)
    if found.doubt > allowed:
        raise ValueError(
            f"the points scatter by about {scatter:.2g} m, which leaves the curvature unknown to {found.doubt:.2g} "
            f"1/m, allowed are {allowed:.2g}; give cleaner points, or accept it with smoothing={scatter:.2g} (m, "
            f"standard deviation): changes of curvature within {found.shortest:.0f} m are then flattened"
        )
    if loud:
        warnings.warn(f"road {found.road.name!r}: {cost}; smoothing= says how far points scatter", stacklevel=2)


def _nearest(road: Road, line: Floats) -> tuple[Floats, Floats]:
    """Arc length and distance of the road's nearest place to each of its points, m."""
    chord = np.hypot(*np.diff(np.vstack([line, line[:1]]) if road.closed else line, axis=0).T)
    with np.errstate(all="ignore"):
        begin = np.concatenate([[0.0], np.cumsum(chord)])[: len(line)]
        s = begin * road.length / chord.sum()
        for _ in range(8):
            heading = road.heading(s)
            offset = line - road.position(s)
            ahead = np.cos(heading) * offset[:, 0] + np.sin(heading) * offset[:, 1]
            s = s + np.clip(ahead, -2.0, 2.0)
            if not road.closed:
                s = np.clip(s, 0.0, road.length)
        return s, np.hypot(*(line - road.position(s)).T)
