"""OpenDRIVE: reference lines as they are (line, arc, spiral) or fitted (poly3, paramPoly3), lanes, chained roads."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from lanekeep_env.checks import shown
from lanekeep_env.roads.readers.drawing import Choice, Drawing
from lanekeep_env.roads.readers.markup import number, parse_xml
from lanekeep_env.roads.readers.opendrive_lanes import lane_offset
from lanekeep_env.roads.readers.opendrive_links import chain
from lanekeep_env.roads.road import Floats, Road, curve_segments

#: Pieces of a cubic's arc length, and points of a lane's centre, m.
_STEP = 1.0
#: Gaps between a reference line's pieces that are told, m and rad.
_GAP, _BEND = 0.01, 0.01
_MOST_PIECES = 100_000


def read_opendrive(content: bytes, name: str, choice: Choice) -> Drawing:
    """Read the reference line, or the centre of a lane, of chained roads of an OpenDRIVE file.

    Raises:
        ValueError: it is no such file, or has not what is asked for.
    """
    root = parse_xml(content, name)
    if root.tag != "OpenDRIVE":
        raise ValueError(f"{name} is XML, but its root is not <OpenDRIVE>")
    roads = {road.get("id", ""): road for road in root.iter("road") if road.find("planView") is not None}
    if not roads:
        raise ValueError(f"{name} holds no road with a planView")
    links, told = chain(root, roads, choice.track, name)
    lane = choice.lane or 0
    pieces = [_Piece(roads[one], f"{name}: road {shown(one)}") for one, _ in links]
    notes = [told, *dict.fromkeys(note for piece in pieces for note in piece.notes)]
    if lane == 0:
        parts = [piece.road if on else _reversed(piece.road) for piece, (_, on) in zip(pieces, links, strict=True)]
        notes += ["the reference line (lane= takes a lane's centre)", *_steps(parts)]
        return Drawing(road=_joined(name, parts), assumed=tuple(notes))
    points, widths = [], []
    for piece, (one, onward) in zip(pieces, links, strict=True):
        along = np.linspace(0.0, piece.road.length, max(2, round(piece.road.length / _STEP) + 1))
        # Driven backwards a road's lanes are those of the other sign.
        offset, width = lane_offset(roads[one], along, lane if onward else -lane, f"{name}: road {shown(one)}")
        line = piece.road.position(along, offset)
        points.append(line if onward else line[::-1])
        widths.append(width if onward else width[::-1])
    half = 0.5 * np.concatenate(widths)
    return Drawing(
        np.concatenate(points), widths=np.column_stack([half, half]), assumed=(*notes, f"the centre of lane {lane}")
    )


class _Piece:
    """A road's reference line, and what is to be told of it."""

    def __init__(self, road: Element, name: str) -> None:
        parts = road.findall("planView/geometry")
        if not 1 <= len(parts) <= _MOST_PIECES:
            raise ValueError(f"{name} has {len(parts)} pieces of geometry; allowed are 1 to {_MOST_PIECES}")
        shapes = [_shape(part, name) for part in parts if number(part, "length", name) > 1e-9]
        if not shapes:
            raise ValueError(f"{name} has no length")
        lengths, start, end = (np.concatenate(column) for column in zip(*(shape for shape, _ in shapes), strict=True))
        origin = tuple(number(parts[0], key, name) for key in ("x", "y", "hdg"))
        self.road = Road(name, lengths, start, end, origin=(origin[0], origin[1], origin[2]))
        self.notes: list[str] = []
        kinds = {kind for _, kind in shapes if kind not in ("line", "arc", "spiral")}
        if kinds:
            self.notes.append(f"{', '.join(sorted(kinds))} fitted by clothoids every {_STEP:g} m")
        self._check_gaps([p for p in parts if number(p, "length", name) > 1e-9], [len(s[0]) for s, _ in shapes], name)

    def _check_gaps(self, parts: Sequence[Element], counts: Sequence[int], name: str) -> None:
        borders = np.concatenate([[0], np.cumsum(counts)])[:-1]
        given = np.array([[number(part, key, name) for key in ("x", "y", "hdg")] for part in parts])
        gap = float(np.hypot(*(self.road.points[borders] - given[:, :2]).T).max())
        turn = self.road.headings[borders] - given[:, 2]
        bend = float(np.abs(np.angle(np.exp(1j * turn))).max())
        if gap > _GAP or bend > _BEND:
            self.notes.append(f"the reference line's pieces do not meet by up to {gap:.3g} m and {bend:.3g} rad")


def _shape(part: Element, name: str) -> tuple[tuple[Floats, Floats, Floats], str]:
    """Lengths and curvatures of a piece of geometry, and its kind."""
    length = number(part, "length", name)
    if not 0.0 < length <= 1e6:
        raise ValueError(f"{name}: <geometry> length={length:g} m; allowed are lengths > 0 up to 1e6 m")
    for shape in part:
        kind = shape.tag
        if kind == "line":
            return _one(length, 0.0, 0.0), kind
        if kind == "arc":
            bend = number(shape, "curvature", name)
            return _one(length, bend, bend), kind
        if kind == "spiral":
            return _one(length, number(shape, "curvStart", name), number(shape, "curvEnd", name)), kind
        if kind in ("poly3", "paramPoly3"):
            return _cubic(shape, length, name), kind
    raise ValueError(f"{name}: <geometry> holds no line, arc, spiral, poly3 or paramPoly3")


def _one(length: float, start: float, end: float) -> tuple[Floats, Floats, Floats]:
    return np.array([length]), np.array([start]), np.array([end])


def _cubic(shape: Element, length: float, name: str) -> tuple[Floats, Floats, Floats]:
    """Clothoids along a cubic: its headings kept, its curvature linear in between."""
    if shape.tag == "poly3":
        u = np.array([0.0, 1.0, 0.0, 0.0])
        v = np.array([number(shape, key, name) for key in "abcd"])
        fine = np.linspace(0.0, length, 20 * 8 + 1)
        last = float(np.interp(length, _way(u, v, fine), fine))  # its u ends where its arc length does
    else:
        u = np.array([number(shape, f"{key}U", name) for key in "abcd"])
        v = np.array([number(shape, f"{key}V", name) for key in "abcd"])
        last = 1.0 if shape.get("pRange", "normalized") == "normalized" else length
    count = max(8, min(20_000, int(np.ceil(length / _STEP))))
    fine = np.linspace(0.0, last, 20 * count + 1)
    du, dv = _slopes(u, v, fine)
    pace = np.hypot(du, dv)
    if not pace.min() > 1e-9 * length / last:
        raise ValueError(f"{name}: <{shape.tag}> stands still or turns back")
    bend = (du * np.polyval([6 * v[3], 2 * v[2]], fine) - dv * np.polyval([6 * u[3], 2 * u[2]], fine)) / pace**3
    heading = np.unwrap(np.arctan2(dv, du))
    at = np.arange(0, len(fine), 20)
    return curve_segments(_way(u, v, fine)[at], bend[at], heading[at])


def _slopes(u: Floats, v: Floats, at: Floats) -> tuple[Floats, Floats]:
    du, dv = (np.polyval([3 * c[3], 2 * c[2], c[1]], at) for c in (u, v))
    return du, dv


def _way(u: Floats, v: Floats, at: Floats) -> Floats:
    """Arc length along a cubic, by the trapezoidal rule."""
    pace = np.hypot(*_slopes(u, v, at))
    return np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(at))])


def _reversed(road: Road) -> Road:
    x, y = road.points[-1]
    return Road(
        road.name,
        road.lengths[::-1],
        -road.curvature_end[::-1],
        -road.curvature_start[::-1],
        origin=(float(x), float(y), float(road.headings[-1] + np.pi)),
    )


def _steps(roads: Sequence[Road]) -> list[str]:
    """What is told of roads whose reference lines do not meet: inside junctions these may lie elsewhere in the lane."""
    gaps = [float(np.hypot(*(after.points[0] - before.points[-1]))) for before, after in itertools.pairwise(roads)]
    turns = [float(after.headings[0] - before.headings[-1]) for before, after in itertools.pairwise(roads)]
    gap, bend = max(gaps, default=0.0), max((abs(math.remainder(turn, math.tau)) for turn in turns), default=0.0)
    if gap <= _GAP and bend <= _BEND:
        return []
    return [f"roads do not meet by up to {gap:.3g} m and {bend:.3g} rad: each goes on where the one before ends"]


def _joined(name: str, roads: Sequence[Road]) -> Road:
    lengths, start, end = (
        np.concatenate([getattr(road, key) for road in roads])
        for key in ("lengths", "curvature_start", "curvature_end")
    )
    return Road(name, lengths, start, end, origin=roads[0].origin)
