"""A road's centre line: curvature, piecewise linear over arc length, and the geometry that follows from it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_env.checks import shown

Floats = NDArray[np.float64]

#: Most that a segment may turn, rad (159 full circles), and most segments of a road.
MOST_TURN = 1000.0
MOST_SEGMENTS = 1_000_000

# Ten-point Gauss-Legendre integrates the position over a turn of up to 1 rad to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True, eq=False)
class Road:
    """Segments of linear curvature (straights, arcs, clothoids); the curvature may jump between them.

    Attributes:
        name: what tables and plots call it.
        lengths: of the segments, m, (n,).
        curvature_start, curvature_end: of each segment, 1/m, left positive, (n,).
        closed: the end is the start.
        origin: x (m), y (m) and heading (rad) of the start.
        fit_error: largest distance of a given point from the road, m (roads read from files).
        given: the points that the road was fitted to, m, (m, 2), or None.
        marked: whether a camera can see the edges of each segment, (n,), or None where it can everywhere.
        beside: at the given points: arc length, width to the left and to the right (m; NaN where the file has none) and
            speed (m/s or NaN), (m, 4), or None.
        assumed: what was taken for granted when the road was read from a file, one phrase each.

    Beyond the end of an open road its last curvature goes on; a closed road repeats.

    Raises:
        ValueError: no segments or too many, numbers that are not finite, or a segment that turns absurdly.
    """

    name: str
    lengths: Floats
    curvature_start: Floats
    curvature_end: Floats
    closed: bool = False
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    fit_error: float = 0.0
    given: Floats | None = field(default=None, repr=False)
    marked: NDArray[np.bool_] | None = field(default=None, repr=False)
    beside: Floats | None = field(default=None, repr=False)
    assumed: tuple[str, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        for key in ("lengths", "curvature_start", "curvature_end"):
            values = np.array(getattr(self, key), dtype=np.float64)
            values.flags.writeable = False
            object.__setattr__(self, key, values)
        name, count = f"road {shown(self.name)}", self.lengths.size
        if not (self.lengths.shape == self.curvature_start.shape == self.curvature_end.shape == (count,)) or not count:
            raise ValueError(f"{name} needs equally many lengths and curvatures, at least one")
        _check_count(name, count)
        if not (np.isfinite(self.lengths).all() and (self.lengths > 0).all()):
            raise ValueError(f"{name} has a segment length that is not a finite number > 0 m")
        peaks = np.maximum(np.abs(self.curvature_start), np.abs(self.curvature_end))
        if not np.isfinite(peaks).all():
            raise ValueError(f"{name} has a curvature that is not a finite number")
        worst = int(np.argmax(peaks * self.lengths))
        if peaks[worst] * self.lengths[worst] > MOST_TURN:
            raise ValueError(
                f"{name}, segment {worst}: a curvature of {peaks[worst]:.3g} 1/m on a length of "
                f"{self.lengths[worst]:.3g} m turns by more than {MOST_TURN:g} rad"
            )

    @cached_property
    def stations(self) -> Floats:
        """Arc length at the segment borders, m, (n + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @property
    def length(self) -> float:
        """Total arc length, m."""
        return float(self.stations[-1])

    @cached_property
    def headings(self) -> Floats:
        """Heading at the segment borders, rad, not wrapped, (n + 1,)."""
        turns = 0.5 * (self.curvature_start + self.curvature_end) * self.lengths
        return self.origin[2] + np.concatenate([[0.0], np.cumsum(turns)])

    @cached_property
    def points(self) -> Floats:
        """Position of the segment borders, m, (n + 1, 2)."""
        slope = (self.curvature_end - self.curvature_start) / self.lengths
        steps = chords(self.headings[:-1], self.curvature_start, slope, self.lengths)
        return np.array(self.origin[:2]) + np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])

    @property
    def peak_curvature(self) -> float:
        """Largest |curvature|, 1/m."""
        return float(max(np.abs(self.curvature_start).max(), np.abs(self.curvature_end).max()))

    def curvature(self, s: ArrayLike) -> Floats:
        """Curvature at arc length ``s`` (m), 1/m."""
        index, along, _ = self._locate(s)
        return self._extended[0][index] + self._extended[1][index] * along

    def heading(self, s: ArrayLike) -> Floats:
        """Heading at arc length ``s`` (m), rad, not wrapped."""
        index, along, laps = self._locate(s)
        start, slope = self._extended
        turn = laps * (self.headings[-1] - self.headings[0])
        return turn + self.headings[index] + (start[index] + 0.5 * slope[index] * along) * along

    def position(self, s: ArrayLike, lateral: ArrayLike = 0.0) -> Floats:
        """Position ``lateral`` metres left of the centre line at arc length ``s`` (m): (..., 2), m."""
        index, along, _ = self._locate(s)
        start, slope = self._extended
        chord = chords(self.headings[index], start[index], slope[index], along)
        heading = self.headings[index] + (start[index] + 0.5 * slope[index] * along) * along
        normal = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        return self.points[index] + chord + np.asarray(lateral, dtype=np.float64)[..., None] * normal

    def is_marked(self, s: ArrayLike) -> NDArray[np.bool_]:
        """Whether a camera can see the edges at arc length ``s`` (m); beyond the end of an open road it can."""
        index, _, _ = self._locate(s)
        if self.marked is None:
            return np.ones(np.shape(index), dtype=np.bool_)
        return np.append(self.marked, True)[index]

    @cached_property
    def _extended(self) -> tuple[Floats, Floats]:
        """Start curvature and slope of the segments, with one more that goes on beyond the end."""
        slope = (self.curvature_end - self.curvature_start) / self.lengths
        return np.append(self.curvature_start, self.curvature_end[-1]), np.append(slope, 0.0)

    def _locate(self, s: ArrayLike) -> tuple[NDArray[np.intp], Floats, Floats]:
        """Segment, distance from its start and completed laps."""
        s = np.asarray(s, dtype=np.float64)
        laps = np.floor(s / self.length) if self.closed else np.zeros_like(s)
        s = s - laps * self.length
        last = len(self.lengths) - 1 if self.closed else len(self.lengths)
        index = np.clip(np.searchsorted(self.stations, s, side="right") - 1, 0, last)
        return index, s - self.stations[index], laps

    def refined(self, max_length: ArrayLike) -> Road:
        """Return the same curve with no segment longer than ``max_length`` (m; one number or one a segment)."""
        longest = np.asarray(max_length)
        if not (longest > 0.0).all():
            raise ValueError(f"road {shown(self.name)}: max_length={shown(max_length)} must be > 0 m")
        pieces = np.maximum(1, np.ceil(self.lengths / longest - 1e-9))
        _check_count(f"road {shown(self.name)}", pieces.sum())
        pieces = pieces.astype(np.intp)
        owner = np.repeat(np.arange(len(pieces)), pieces)
        part = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        rise = (self.curvature_end - self.curvature_start)[owner] / pieces[owner]
        start = self.curvature_start[owner] + rise * part
        marked = None if self.marked is None else self.marked[owner]
        return replace(
            self,
            lengths=(self.lengths / pieces)[owner],
            curvature_start=start,
            curvature_end=start + rise,
            marked=marked,
        )

    def without_marking(self, stretches: ArrayLike) -> Road:
        """Return the same curve with no visible edge on ``stretches``, from and to in m of arc length, (k, 2)."""
        stretches = np.asarray(stretches, dtype=np.float64).reshape(-1, 2).clip(0.0, self.length)
        if np.isnan(stretches).any():
            raise ValueError(f"road {shown(self.name)}: a stretch without marking holds a value that is not a number")
        # A border of the road stays where it is: what comes within a micrometre of it is moved there.
        after = np.searchsorted(self.stations, stretches).clip(1, len(self.stations) - 1)
        low, high = self.stations[after - 1], self.stations[after]
        nearest = np.where(stretches - low <= high - stretches, low, high)
        stretches = np.where(np.abs(stretches - nearest) < 1e-6, nearest, stretches)
        cuts = np.unique(np.concatenate([self.stations, stretches.ravel()]))
        cuts = cuts[np.concatenate([[True], np.diff(cuts) > 1e-6])]
        cuts[-1] = self.length
        middle = 0.5 * (cuts[1:] + cuts[:-1])
        owner = np.searchsorted(self.stations, middle, side="right") - 1
        start, slope = self.curvature_start[owner], self._extended[1][owner]
        first, last = cuts[:-1] - self.stations[owner], cuts[1:] - self.stations[owner]
        # Hidden: of the stretches that begin before it, one ends behind it.
        begins, ends = stretches[np.argsort(stretches[:, 0])].T
        begun = np.searchsorted(begins, middle)
        hidden = np.concatenate([[-np.inf], np.maximum.accumulate(ends)])[begun] > middle
        seen = np.ones(len(owner), dtype=np.bool_) if self.marked is None else self.marked[owner]
        return replace(
            self,
            lengths=np.diff(cuts),
            curvature_start=start + slope * first,
            curvature_end=start + slope * last,
            marked=seen & ~hidden,
        )

    def check_lane(self, half_width: float) -> None:
        """Raise ValueError where the road turns so tightly that a lane of that half width folds over itself."""
        peaks = np.maximum(np.abs(self.curvature_start), np.abs(self.curvature_end))
        tightest = int(np.argmax(peaks))
        if peaks[tightest] * half_width >= 1.0:
            raise ValueError(
                f"road {self.name!r} has a radius of {1 / peaks[tightest]:.3g} m at "
                f"s = {self.stations[tightest]:.1f} m; "
                f"a lane {2 * half_width:g} m wide needs more than {half_width:g} m"
            )


def _check_count(name: str, count: float) -> None:
    if not count <= MOST_SEGMENTS:
        raise ValueError(f"{name} has {count:.7g} segments; allowed are {MOST_SEGMENTS}")


def chords(heading: Floats, curvature: Floats, slope: Floats, length: Floats) -> Floats:
    """Displacement over clothoid pieces of given start heading, curvature, its slope and length: (..., 2), m."""
    turn = (np.abs(curvature) + np.abs(slope * length)) * np.abs(length)
    most = turn.max(initial=0.0)
    if not most <= 100.0 * MOST_TURN:
        raise ValueError(f"a position on a curve that turns by {most:.3g} rad cannot be found; go less far")
    pieces = max(1, int(np.ceil(most)))
    step = np.asarray(length / pieces)[..., None]
    total = np.zeros((*np.shape(length), 2))
    for piece in range(pieces):
        x = step * (piece + 0.5 * (_NODES + 1.0))
        angle = heading[..., None] + (curvature[..., None] + 0.5 * slope[..., None] * x) * x
        weights = 0.5 * step * _WEIGHTS
        total[..., 0] += (weights * np.cos(angle)).sum(axis=-1)
        total[..., 1] += (weights * np.sin(angle)).sum(axis=-1)
    return total


def fitted(name: str, stations: Floats, curvatures: Floats, headings: Floats) -> Road:
    """Return the piecewise-linear road through a smooth curve, with the curve's headings at the borders kept exactly.

    Each segment takes the slope between its ends and is shifted by a constant so that its turn is the
    true one; headings then do not drift, and positions by the fourth order of the segment length only.
    The price is a jump of second order between segments.

    Args:
        name: the road's.
        stations: arc length of the borders, m, (n + 1,).
        curvatures: of the curve there, 1/m, (n + 1,).
        headings: of the curve there, rad, (n + 1,).
    """
    segments = curve_segments(stations, curvatures, headings)
    return Road(name, *segments, origin=(0.0, 0.0, float(headings[0])))


def curve_segments(stations: Floats, curvatures: Floats, headings: Floats) -> tuple[Floats, Floats, Floats]:
    """Return lengths, and curvatures at both ends, of the segments of `fitted`."""
    lengths = np.diff(stations)
    shift = np.diff(headings) / lengths - 0.5 * (curvatures[:-1] + curvatures[1:])
    return lengths, curvatures[:-1] + shift, curvatures[1:] + shift
