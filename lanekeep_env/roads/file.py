"""Roads from files and from memory: what was drawn becomes a road (readers in `readers`, fits in `fit`)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lanekeep_env.checks import require
from lanekeep_env.files import read_bounded
from lanekeep_env.roads.fit import fit_centre_line
from lanekeep_env.roads.readers import Choice, Drawing, read_drawing
from lanekeep_env.roads.road import Floats, Road
from lanekeep_env.roads.smooth import close

FEWEST_POINTS = 8
WIDEST_SPACING = 200.0
#: Most bytes of a file.
LARGEST_FILE = 64 << 20
#: Largest coordinate, m: more than any map projection has.
FARTHEST = 1e8
#: How near end and start of given curvature must be to make a loop: as a share of the length, and in turns.
_NEAR, _ROUND = 0.01, 0.02


def read_road(
    path: str | Path,
    closed: bool | None = None,
    smoothing: float | None = None,
    track: str | None = None,
    lane: int | None = None,
) -> Road:
    """Read a road file.

    By the ending of its name: tables (.csv, .txt, .tsv, .dat), OpenDRIVE (.xodr), CommonRoad (.xml), .gpx, .kml,
    .geojson. A table's columns go by their names (`x_m`, `y_m`; `lat`, `lon`; `s_m`, `kappa_radpm`; `length_m`,
    `kappa_start`, `kappa_end`; widths and speed beside them), which may stand in a comment; without names two are x, y
    and four x, y, width right, width left in m. Delimiter and decimal sign are those of the file. What was assumed is
    kept in the road's `assumed`. The line may cross itself.

    Args:
        path: of the file.
        closed: whether the last point leads back to the first; None finds out from their distance.
        smoothing: standard deviation by which the points scatter, m; None estimates it.
        track, lane: which of several lines (see `Choice`).

    Raises:
        ValueError: one line that names the file, the place, the fault and what is allowed.
    """
    return make_road(path, read_content(path), closed, smoothing, Choice(track, lane))


def read_content(path: str | Path) -> bytes:
    """Return a file's content; raises ValueError, one line, where it is missing, too large or no ordinary file."""
    try:
        return read_bounded(path, LARGEST_FILE)
    except OSError as error:
        raise ValueError(f"road file {str(path)!r} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ValueError(f"road file {str(path)!r} cannot be read: {error}") from None


def make_road(
    path: str | Path,
    content: bytes,
    closed: bool | None,
    smoothing: float | None = None,
    choice: Choice = Choice(),  # noqa: B008 (frozen)
) -> Road:
    """Make the road of a file's content; ``path`` names it (see `read_road`)."""
    name = f"road file {str(path)!r}"
    require("smoothing", smoothing, "m", at_least=0.0, at_most=100.0, optional=True)
    drawing = read_drawing(path, content, choice, name)
    return road_of(drawing, Path(path).stem, name, closed, smoothing)


def road_of(drawing: Drawing, title: str, name: str, closed: bool | None, smoothing: float | None) -> Road:
    """Make the road that was drawn.

    Args:
        drawing: of it.
        title: the road's name.
        name: what errors call it.
        closed, smoothing: as for `read_road`.
    """
    if drawing.road is not None:
        if smoothing is not None:
            raise ValueError(f"{name}: smoothing={smoothing} has no effect: it gives the curvature itself, not points")
        road = _closed_up(replace(drawing.road, name=title), name, closed)
        stations = road.stations[: None if drawing.speeds is None else len(drawing.speeds)]
    else:
        points = _checked(drawing, name)
        try:
            loop = _is_closed(points) if closed is None else closed
            road = fit_centre_line(title, points, loop, smoothing, drawing.rounding, drawing.tolerance)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
        stations = road.beside[:, 0] if road.beside is not None else np.zeros(len(points))
    beside = np.full((len(stations), 4), np.nan)
    beside[:, 0] = stations
    if drawing.widths is not None:
        beside[:, 1:3] = drawing.widths[: len(stations)]
    if drawing.speeds is not None:
        beside[:, 3] = drawing.speeds[: len(stations)]
    nothing = drawing.widths is None and drawing.speeds is None
    assumed = (*drawing.assumed, "a loop" if road.closed else "an open line", *road.assumed)
    return replace(road, beside=None if nothing else beside, assumed=assumed)


def _closed_up(road: Road, name: str, closed: bool | None) -> Road:
    """A road of given curvature as a loop, where its end is near its start."""
    gap = float(np.hypot(*(road.points[-1] - road.points[0])))
    turn = (road.headings[-1] - road.headings[0]) / (2.0 * np.pi)
    near = gap < _NEAR * road.length and abs(turn - round(turn)) < _ROUND
    if not (near if closed is None else closed):
        return road
    if not near:
        raise ValueError(
            f"{name}: closed=True is not allowed: the end is {gap:.3g} m and {abs(turn - round(turn)):.2g} turns away "
            f"from the start; allowed are {_NEAR:.0%} of the length and {_ROUND} turns"
        )
    try:
        # Of few segments a loop has too little to give.
        loop = close(replace(road.refined(road.length / 16), closed=True))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    return replace(loop, assumed=(*loop.assumed, f"a gap of {gap:.2g} m at its end bent away"))


def _checked(drawing: Drawing, name: str) -> Floats:
    """The points, if they may be a road's."""
    points = drawing.points if drawing.points is not None else np.zeros((0, 2))
    if len(points) < FEWEST_POINTS:
        raise ValueError(f"{name} has {len(points)} points; at least {FEWEST_POINTS} are needed")
    far = int(np.argmax(np.abs(points).max(axis=1)))
    if np.abs(points[far]).max() > FARTHEST:
        raise ValueError(
            f"{name}, {drawing.place(far)}: ({points[far, 0]:g}, {points[far, 1]:g}) m is too far from the origin; "
            f"allowed are coordinates up to {FARTHEST:g} m (are they in m?)"
        )
    spacing = np.hypot(*np.diff(points, axis=0).T)
    if (spacing < 1e-6).sum() > 0.5 * len(points):
        raise ValueError(f"{name}: most points are the same as the one before; successive points must differ")
    wide = int(np.argmax(spacing))
    if spacing[wide] > WIDEST_SPACING:
        raise ValueError(
            f"{name}, {drawing.place(wide + 1)}: {spacing[wide]:.0f} m from the point before; allowed are "
            f"{WIDEST_SPACING:.0f} m: give more points, or their unit (in mm: name the columns x_mm,y_mm; in degrees: "
            f"lat,lon)"
        )
    return points


def _is_closed(points: Floats) -> bool:
    """A loop ends within three point distances of its start, having gone well away from it."""
    gap = float(np.hypot(*(points[-1] - points[0])))
    median = float(np.median(np.hypot(*np.diff(points, axis=0).T)))
    return gap <= 3.0 * median and float(np.ptp(points, axis=0).max()) > 4.0 * gap
