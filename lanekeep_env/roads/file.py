"""Centre lines from CSV files: reading and checking the points (`fit.py` makes the road)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lanekeep_env.checks import shown
from lanekeep_env.files import read_bounded
from lanekeep_env.roads.fit import LARGEST_FIT_ERROR, fit_centre_line
from lanekeep_env.roads.road import Floats, Road

FEWEST_POINTS = 8
WIDEST_SPACING = 200.0
#: Most points, lines with comments, characters of a line, and bytes of a file: 100 km every half metre, in any format.
MOST_POINTS = 200_000
MOST_LINES = 1_000_000
LONGEST_LINE = 10_000
LARGEST_FILE = 64 << 20
#: Largest coordinate, m: more than any map projection has.
FARTHEST = 1e8

_LINE_ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"


def read_road(path: str | Path, closed: bool | None = None) -> Road:
    """Read a centre line and fit a road to it.

    The format: one point a line, ``x, y`` in m, optionally followed by the widths to the right and left of
    it (read and checked, not needed by the fit); separated by commas, semicolons, tabs or spaces; lines
    that start with ``#`` and one line of column names are skipped. The line may cross itself.

    Args:
        path: of the file.
        closed: whether the last point leads back to the first; None finds out from their distance.

    Raises:
        ValueError: one line that names the file, the line, the fault and what is allowed.
    """
    return make_road(path, read_content(path), closed)


def read_content(path: str | Path) -> bytes:
    """Return a file's content; raises ValueError, one line, where it is missing, too large or no ordinary file."""
    try:
        return read_bounded(path, LARGEST_FILE)
    except OSError as error:
        raise ValueError(f"road file {str(path)!r} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ValueError(f"road file {str(path)!r} cannot be read: {error}") from None


def make_road(path: str | Path, content: bytes, closed: bool | None) -> Road:
    """Make the road of a centre-line file's content; ``path`` names it (see `read_road`)."""
    name = f"road file {str(path)!r}"
    points = read_points(content, name)
    try:
        road = fit_centre_line(Path(path).stem, points, _is_closed(points) if closed is None else closed)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if not road.fit_error <= LARGEST_FIT_ERROR:
        raise ValueError(
            f"{name}: the road misses a point by {road.fit_error:.2f} m, allowed are "
            f"{LARGEST_FIT_ERROR} m; points this rough or far apart (median {_median_spacing(points):.1f} m) "
            f"do not define a road"
        )
    return road


def read_points(content: bytes, name: str) -> Floats:
    """Return the points of a centre-line file, (n, 2), m; ``name`` is what errors call it."""
    rows, numbers = _rows(content, name)
    if not rows:
        raise ValueError(f"{name} is empty; expected lines 'x, y[, width right, width left]' in m")
    if len(rows) < FEWEST_POINTS:
        raise ValueError(f"{name} has {len(rows)} points; at least {FEWEST_POINTS} are needed")
    points = np.array([row[:2] for row in rows], dtype=np.float64)
    far = int(np.argmax(np.abs(points).max(axis=1)))
    if np.abs(points[far]).max() > FARTHEST:
        raise ValueError(
            f"{name}, line {numbers[far]}: ({points[far, 0]:g}, {points[far, 1]:g}) m is too far from the origin; "
            f"allowed are coordinates up to {FARTHEST:g} m (are they in m?)"
        )
    spacing = np.hypot(*np.diff(points, axis=0).T)
    same = np.flatnonzero(spacing < 1e-6)
    if len(same):
        raise ValueError(
            f"{name}, line {numbers[same[0] + 1]}: the same point as on line {numbers[same[0]]}; "
            "successive points must differ"
        )
    wide = int(np.argmax(spacing))
    if spacing[wide] > WIDEST_SPACING:
        raise ValueError(
            f"{name}, line {numbers[wide + 1]}: {spacing[wide]:.0f} m from the point before; allowed are "
            f"{WIDEST_SPACING:.0f} m (are the coordinates in m?)"
        )
    return points


def _rows(content: bytes, name: str) -> tuple[list[list[float]], list[int]]:
    """Numbers of each line that holds some, and its number in the file."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{name} is not a text file; expected lines 'x, y[, width right, width left]' in m") from None
    count = sum(map(text.count, _LINE_ENDS))
    if count > MOST_LINES:
        raise ValueError(f"{name} has {count} lines; allowed are {MOST_LINES}")
    rows: list[list[float]] = []
    numbers: list[int] = []
    names_allowed = True
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > LONGEST_LINE:
            raise ValueError(f"{name}, line {number}: {len(line)} characters; allowed are {LONGEST_LINE}")
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        cells = [cell for cell in re.split(r"[,;\s]+", line) if cell]
        try:
            row = [_number(cell) for cell in cells]
        except ValueError:
            if names_allowed and not rows and not any(_is_number(cell) for cell in cells):
                names_allowed = False
                continue
            bad = next(cell for cell in cells if not _is_number(cell))
            raise ValueError(f"{name}, line {number}: {shown(bad)} is not a number") from None
        if len(row) not in (2, 4):
            raise ValueError(f"{name}, line {number}: {len(row)} columns; allowed are 2 (x, y) or 4 (with widths)")
        if not np.isfinite(row).all():
            raise ValueError(f"{name}, line {number}: {shown(line)} holds a value that is not finite")
        if len(row) == 4 and min(row[2:]) < 0.0:
            raise ValueError(f"{name}, line {number}: a width of {min(row[2:])} m; allowed are widths >= 0 m")
        if len(rows) == MOST_POINTS:
            raise ValueError(f"{name}, line {number}: more than {MOST_POINTS} points; leave out some of them")
        rows.append(row)
        numbers.append(number)
    return rows, numbers


def _number(cell: str) -> float:
    """A number in ASCII digits: `float` takes those of all scripts, and 1_000."""
    if not cell.isascii() or "_" in cell:
        raise ValueError
    return float(cell)


def _is_number(cell: str) -> bool:
    try:
        _number(cell)
    except ValueError:
        return False
    return True


def _median_spacing(points: Floats) -> float:
    return float(np.median(np.hypot(*np.diff(points, axis=0).T)))


def _is_closed(points: Floats) -> bool:
    """A loop ends within three point distances of its start, having gone well away from it."""
    gap = float(np.hypot(*(points[-1] - points[0])))
    return gap <= 3.0 * _median_spacing(points) and float(np.ptp(points, axis=0).max()) > 4.0 * gap
