"""What the columns of a table mean: by name, or by position where there are two or four without names."""

from __future__ import annotations

import re

import numpy as np

from lanekeep_env.checks import shown
from lanekeep_env.roads.readers.agreement import compare
from lanekeep_env.roads.readers.drawing import Choice, Drawing
from lanekeep_env.roads.readers.geodetic import projected
from lanekeep_env.roads.readers.table import Table, read_table
from lanekeep_env.roads.road import Floats, Road

#: Names of what a column may hold, without units.
_NAMES: dict[str, tuple[str, ...]] = {
    "x": ("x", "xs", "px", "posx", "xpos", "positionx", "xcoord", "east", "easting", "xref", "xcenter", "xcentre"),
    "y": ("y", "ys", "py", "posy", "ypos", "positiony", "ycoord", "north", "northing", "yref", "ycenter", "ycentre"),
    "s": ("s", "station", "arclength", "distance", "dist", "sracetraj", "sref"),
    "kappa": ("kappa", "curvature", "curv", "kapparacetraj", "kapparef"),
    "psi": ("psi", "heading", "yaw", "theta", "psiracetraj", "psiref"),
    "speed": ("v", "vx", "speed", "velocity", "vxracetraj", "vref"),
    "right": ("wtrright", "widthright", "rightwidth", "wright", "right", "wr"),
    "left": ("wtrleft", "widthleft", "leftwidth", "wleft", "left", "wl"),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "lng", "long", "longitude"),
    "length": ("length", "len", "l", "ds"),
    "start": ("kappastart", "curvaturestart", "curvstart", "startcurvature", "kappa0", "k0"),
    "end": ("kappaend", "curvatureend", "curvend", "endcurvature", "kappa1", "k1"),
}
_MEANING = {name: quantity for quantity, names in _NAMES.items() for name in names}
#: Units by how they are written, and their factor to SI.
_UNITS: dict[str, float] = {
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres", "deg", "mps", "m/s", "radpm", "rad/m", "1/m"), 1.0),
    **dict.fromkeys(("1pm", "pm", "°"), 1.0),
    **{
        "km": 1e3,
        "cm": 1e-2,
        "mm": 1e-3,
        "ft": 0.3048,
        "kmh": 1 / 3.6,
        "km/h": 1 / 3.6,
        "kph": 1 / 3.6,
        "mph": 0.44704,
    },
    "1/km": 1e-3,
    "rad": 1.0,
}
#: What each quantity may be given in.
_ALLOWED: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("x", "y", "s", "left", "right", "length"), ("m", "km", "cm", "mm", "ft")),
    **dict.fromkeys(("kappa", "start", "end"), ("radpm", "rad/m", "1/m", "1pm", "1/km")),
    "speed": ("mps", "m/s", "kmh", "km/h", "kph", "mph"),
    "psi": ("rad", "deg", "°"),
    **dict.fromkeys(("lat", "lon"), ("deg", "°")),
}
_LONG = {"meter": "m", "metre": "m", "meters": "m", "metres": "m"}
WAY_OUT = "name the columns in a first line, e.g. x_m,y_m (or lat,lon; s_m,kappa_radpm; length_m,kappa_start,kappa_end)"


def read_columns(content: bytes, name: str, choice: Choice) -> Drawing:
    """Read a table of points, of curvature along the road, or of clothoids; see `read_road`."""
    return drawing_of(read_table(content, name), name)


def drawing_of(table: Table, name: str) -> Drawing:
    """Return what a table draws; ValueError says what its columns should be."""
    columns, assumed = _columns(table, name)
    assumed = (*table.assumed, *assumed)
    for side in ("right", "left"):
        if side in columns and columns[side].min() < 0.0:
            row = int(np.argmin(columns[side]))
            raise ValueError(
                f"{name}, line {table.lines[row]}: a width of {columns[side][row]} m; allowed are widths >= 0 m"
            )
    widths = np.column_stack([columns["left"], columns["right"]]) if {"left", "right"} <= columns.keys() else None
    speeds = columns.get("speed")
    if speeds is not None and speeds.min() < 0.0:
        raise ValueError(
            f"{name}, line {table.lines[int(np.argmin(speeds))]}: a speed of {speeds.min()} m/s; allowed >= 0"
        )
    for needed in _MAKING:
        if needed <= columns.keys():
            idle = columns.keys() - needed - {"left", "right", "speed"}
            assumed += (f"not needed: {', '.join(sorted(idle))}",) if idle else ()
            return _drawing(needed, columns, table, (widths, speeds, assumed), name)
    known = ", ".join(columns) or "none"
    raise ValueError(f"{name}: of the columns {shown(table.names)} known are {known}, which makes no road; {WAY_OUT}")


#: What makes a road, the first that is there.
_MAKING = tuple(map(frozenset, (("x", "y"), ("lat", "lon"), ("length", "start", "end"), ("s", "kappa"))))


def _drawing(
    needed: frozenset[str],
    columns: dict[str, Floats],
    table: Table,
    beside: tuple[Floats | None, Floats | None, tuple[str, ...]],
    name: str,
) -> Drawing:
    widths, speeds, assumed = beside
    if "x" in needed:
        points = np.column_stack([columns["x"], columns["y"]])
        return Drawing(points, None, table.lines, widths, speeds, (*assumed, *compare(points, columns, name)))
    if "lat" in needed:
        points, rounding, how = projected(columns["lat"], columns["lon"], name)
        return Drawing(points, None, table.lines, widths, speeds, (*assumed, how), rounding)
    if "length" in needed:
        return Drawing(None, clothoids(name, columns["length"], columns["start"], columns["end"]), assumed=assumed)
    return Drawing(None, _profile(table, columns["s"], columns["kappa"], name), None, widths, speeds, assumed)


def clothoids(name: str, lengths: Floats, start: Floats, end: Floats) -> Road:
    """Return the road of clothoids given by length (m) and curvature at either end (1/m)."""
    try:
        return Road(name, lengths, start, end)
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(name) else f"{name}: {error}") from None


def _profile(table: Table, s: Floats, kappa: Floats, name: str) -> Road:
    lengths = np.diff(s)
    if len(lengths) == 0 or lengths.min() <= 0.0:
        row = int(np.argmin(lengths)) + 1 if len(lengths) else 0
        raise ValueError(f"{name}, line {table.lines[row]}: the arc length s must rise from line to line")
    return clothoids(name, lengths, kappa[:-1], kappa[1:])


def _columns(table: Table, name: str) -> tuple[dict[str, Floats], tuple[str, ...]]:
    """Columns by quantity, in SI units."""
    if table.names is None:
        return _by_position(table, name)
    found: dict[str, Floats] = {}
    read: list[str] = []
    unread: list[str] = []
    for k, heading in enumerate(table.names):
        quantity, unit = _quantity(heading)
        if quantity is not None and heading in table.names[:k]:
            raise ValueError(f"{name}: two columns are named {shown(heading)}; name one of them otherwise")
        if quantity is None or quantity in found:
            unread.append(heading)
            continue
        if unit is None and table.units is not None:
            unit = _unit(table.units[k])
        if unit is not None and unit not in _ALLOWED[quantity]:
            raise ValueError(
                f"{name}: column {shown(heading)} is in {shown(unit)}; allowed: {', '.join(_ALLOWED[quantity])}"
            )
        found[quantity] = table.values[:, k] * (1.0 if unit is None else _UNITS[unit])
        if quantity == "psi" and unit in ("deg", "°"):
            found[quantity] = np.radians(found[quantity])
        read.append(f"{_short(heading)} as {quantity}" + ("" if unit is None else f" in {unit}"))
    assumed = ["columns " + ", ".join(read)] if read else []
    if unread:
        assumed.append("not read: " + ", ".join(map(_short, unread)))
    return found, tuple(assumed)


def _by_position(table: Table, name: str) -> tuple[dict[str, Floats], tuple[str, ...]]:
    count = table.values.shape[1]
    if count not in (2, 4):
        raise ValueError(
            f"{name}, line {table.lines[0]}: {count} columns without names; allowed are 2 (x, y) or 4 (with widths "
            f"right and left); {_height(table)}{WAY_OUT}"
        )
    if count == 4 and _split_decimals(table.values):
        raise ValueError(
            f"{name}: four columns of whole numbers look like two with a decimal comma; put semicolons between the "
            f"columns, or {WAY_OUT}"
        )
    quantities = ("x", "y", "right", "left")[:count]
    columns = {quantity: table.values[:, k] for k, quantity in enumerate(quantities)}
    return columns, (f"columns without names as {', '.join(quantities)} in m",)


def _height(table: Table) -> str:
    """What to do about a column of three that never changes, as in waypoints of simulators."""
    flat = np.flatnonzero(np.ptp(table.values, axis=0) == 0.0)
    if table.values.shape[1] != 3 or len(flat) != 1:
        return ""
    names = ["x_m", "y_m"]
    names.insert(int(flat[0]), "height")
    return f"column {flat[0] + 1} never changes: if it is the height, begin with the line {','.join(names)}; or "


def _split_decimals(values: Floats) -> bool:
    """Whether 1,5,2,5 may stand for 1.5 and 2.5: the second and fourth columns are digits behind commas."""
    whole = (values == np.round(values)).all() and values[:, 1::2].min() >= 0.0
    return bool(whole and all(len(np.unique(column)) > 4 for column in values[:, 1::2].T))


def _quantity(heading: str) -> tuple[str | None, str | None]:
    """Quantity and unit of a column's name: ``x_m``, ``x [m]``, ``x (m)``, ``x/m``, ``kappa_radpm``, ``vx_mps``."""
    text = heading.strip().lower()
    bracket = re.fullmatch(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]", text)
    if bracket:
        return _MEANING.get(_plain(bracket[1])), _unit(bracket[2])
    if _plain(text) in _MEANING:
        return _MEANING[_plain(text)], None
    parts = re.split(r"[_/\s]+", text)
    for cut in range(len(parts) - 1, 0, -1):
        quantity, unit = _MEANING.get(_plain("".join(parts[:cut]))), _unit("/".join(parts[cut:]))
        if quantity is not None and unit in _UNITS:
            return quantity, unit
    return None, None


def _unit(text: str) -> str:
    text = text.strip().lower().replace(" ", "")
    return _LONG.get(text, text)


def _plain(text: str) -> str:
    return re.sub(r"[_\-\s.]", "", text)


def _short(text: str) -> str:
    return text if text.isprintable() and len(text) <= 30 else shown(text)[:30]
