"""Lines in latitude and longitude: GPX, KML and GeoJSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lanekeep_env.checks import shown
from lanekeep_env.plain import parse_json
from lanekeep_env.roads.readers.drawing import MOST_POINTS, Choice, Drawing
from lanekeep_env.roads.readers.geodetic import projected
from lanekeep_env.roads.readers.markup import as_number, number, parse_xml

#: Most lists, mappings and commas of a GeoJSON file: some seconds and 300 MiB.
MOST_PARTS = 2_000_000
#: Longitude and latitude of each point, deg.
Line = list[tuple[float, float]]


def read_gpx(content: bytes, name: str, choice: Choice) -> Drawing:
    """Read a track's segment or a route of a GPX file."""
    root = parse_xml(content, name)
    if root.tag != "gpx":
        raise ValueError(f"{name} is XML with the root <{_tag(root.tag)}>; expected <gpx>")
    lines: list[Line] = []
    for kind, point in (("trkseg", "trkpt"), ("rte", "rtept")):
        for part in root.iter(kind):
            lines.append([(number(one, "lon", name), number(one, "lat", name)) for one in part.iter(point)])
    return _chosen(lines, name, choice, "track segments and routes")


def read_kml(content: bytes, name: str, choice: Choice) -> Drawing:
    """Read a LineString of a KML file."""
    root = parse_xml(content, name)
    lines: list[Line] = []
    for part in root.iter("LineString"):
        text = part.findtext("coordinates") or ""
        tuples = [words.split(",") for words in text.split()]
        if any(len(words) < 2 for words in tuples):
            raise ValueError(f"{name}: <coordinates> hold something else than longitude,latitude[,height]")
        what = f"{name}: <coordinates>"
        lines.append([(as_number(words[0], what), as_number(words[1], what)) for words in tuples])
    return _chosen(lines, name, choice, "LineStrings")


def read_geojson(content: bytes, name: str, choice: Choice) -> Drawing:
    """Read a LineString, a part of a MultiLineString, or the outer ring of a Polygon of a GeoJSON file."""
    parts = sum(map(content.count, (b"[", b"{", b",")))
    if parts > MOST_PARTS:
        raise ValueError(
            f"{name} holds {parts} lists, mappings and commas; allowed are {MOST_PARTS}: keep the road's line alone"
        )
    try:
        value = parse_json(content)
    except ValueError as error:
        raise ValueError(f"{name} is not JSON: {shown(str(error))}") from None
    lines: list[Line] = []
    _collect(value, lines, name)
    return _chosen(lines, name, choice, "LineStrings")


def _collect(value: Any, lines: list[Line], name: str) -> None:
    """Add all lines in a GeoJSON object, in the file's order."""
    if not isinstance(value, dict):
        raise ValueError(f"{name}: {shown(value)} is no GeoJSON object")
    kind, parts = value.get("type"), value.get("coordinates")
    for key in ("features", "geometries"):
        members = value.get(key)
        for one in members if isinstance(members, list) else ():
            _collect(one, lines, name)
    if kind == "Feature" and value.get("geometry") is not None:
        _collect(value["geometry"], lines, name)
    elif kind == "LineString":
        lines.append(_line(parts, name))
    elif kind == "MultiLineString" or kind == "Polygon":
        whole = parts if isinstance(parts, list) else [parts]
        lines.extend(_line(one, name) for one in (whole[:1] if kind == "Polygon" else whole))


def _line(value: Any, name: str) -> Line:
    good = isinstance(value, list) and all(
        isinstance(one, list) and len(one) >= 2 and all(type(c) in (int, float) for c in one[:2]) for one in value
    )
    if not good:
        raise ValueError(f"{name}: coordinates {shown(value)} are not a list of [longitude, latitude]")
    try:
        return [(float(one[0]), float(one[1])) for one in value]
    except OverflowError:
        raise ValueError(f"{name}: coordinates hold an integer that is no number of degrees") from None


def _chosen(lines: Sequence[Line], name: str, choice: Choice, kind: str) -> Drawing:
    """The line that is asked for, or the longest, on a plane."""
    lines = [line for line in lines if len(line) > 1]
    if not lines:
        raise ValueError(f"{name} holds no {kind} with points")
    if choice.track is None:
        which = max(range(len(lines)), key=lambda k: len(lines[k]))
    elif choice.track.isascii() and choice.track.isdigit() and 1 <= int(choice.track[:9]) <= len(lines):
        which = int(choice.track[:9]) - 1
    else:
        raise ValueError(f"{name}: track={shown(choice.track)} is not there; allowed are the {kind} 1 to {len(lines)}")
    if len(lines[which]) > MOST_POINTS:
        raise ValueError(f"{name} has {len(lines[which])} points; allowed are {MOST_POINTS}: leave out some of them")
    longitude, latitude = np.array(lines[which], dtype=np.float64).T
    points, rounding, how = projected(latitude, longitude, name)
    told = () if len(lines) == 1 else (f"number {which + 1} of {len(lines)} {kind} (track= takes another)",)
    return Drawing(points, assumed=(*told, how), rounding=rounding)


def _tag(tag: str) -> str:
    return tag if tag.isprintable() and len(tag) < 60 else shown(tag)
