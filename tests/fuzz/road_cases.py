"""Damaged and hostile road files."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from file_cases import Case, with_file
from harness import Watch, mutated

from lanekeep_env.roads import RoadFile


def read_road(path: Path, closed: bool | None = None) -> None:
    """Read a road file as a scenario does; nothing else is opened."""
    with Watch() as watch:
        try:
            (road,) = RoadFile(str(path), closed).build()
        finally:
            watch.require_only(path)
    assert np.isfinite(road.points).all() and road.fit_error <= 0.1


def roads(count: int, seed: int, folder: Path) -> Iterator[Case]:
    """Mutations of road files."""
    angle = np.linspace(0.0, 6.2, 60)
    ring = np.column_stack([4.5e5 + 100 * np.cos(angle), 5.4e6 + 60 * np.sin(angle)])
    degrees = np.column_stack([9.1 + (ring[:, 0] - 4.5e5) * 1.4e-5, 48.7 + (ring[:, 1] - 5.4e6) * 9e-6])
    tables = (
        b"# x_m,y_m\n" + b"".join(b"%.3f,%.3f\n" % tuple(point) for point in ring),
        b"x;y;w_right;w_left\n" + b"".join(b"%.3f;%.3f;3.5;4\n" % tuple(point) for point in ring - ring[0]),
        b"".join(b"%d\t%d\r\n" % (10 * k, k * k) for k in range(30)),
        b"x;y\n" + b"".join(b"%.3f;%.3f\n" % tuple(point) for point in ring - ring[0]).replace(b".", b","),
        b"s_m,kappa_radpm,vx_mps\n" + b"".join(b"%d,%.3f,8\n" % (5 * k, 0.01 * (k % 7)) for k in range(40)),
        b"length_m kappa_start kappa_end\n" + b"".join(b"%d 0 %.2f\n" % (10 + k, 0.01 * (k % 3)) for k in range(20)),
        b"lat,lon\n" + b"".join(b"%.7f,%.7f\n" % (lat, lon) for lon, lat in degrees),
    )
    originals = [(".csv", table) for table in tables]
    originals += [(ending, make(degrees)) for ending, make in _MARKED.items()]
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        ending, original = originals[number % len(originals)]
        content, closed = mutated(original, rng), (None, True, False)[rng.integers(3)]
        yield (
            f"road {seed} {number}",
            with_file(folder / f"road{ending}", content, lambda p, c=closed: read_road(p, c)),
        )


def _gpx(degrees: np.ndarray) -> bytes:
    points = b"".join(b'<trkpt lat="%.7f" lon="%.7f"><ele>3</ele></trkpt>\n' % (lat, lon) for lon, lat in degrees)
    return b'<?xml version="1.0"?>\n<gpx><trk><trkseg>\n' + points + b"</trkseg></trk></gpx>\n"


def _kml(degrees: np.ndarray) -> bytes:
    points = b" ".join(b"%.7f,%.7f,0" % tuple(point) for point in degrees)
    return b"<kml><Placemark><LineString><coordinates>" + points + b"</coordinates></LineString></Placemark></kml>"


def _geojson(degrees: np.ndarray) -> bytes:
    points = b", ".join(b"[%.7f, %.7f]" % tuple(point) for point in degrees)
    return b'{"type": "Feature", "geometry": {"type": "LineString", "coordinates": [' + points + b"]}}"


def _xodr(degrees: np.ndarray) -> bytes:
    shapes = (b"<line/>", b'<arc curvature="0.01"/>', b'<spiral curvStart="0.01" curvEnd="-0.02"/>')
    shapes += (b'<poly3 a="0" b="0" c="0.001" d="1e-6"/>',)
    shapes += (b'<paramPoly3 pRange="normalized" aU="0" bU="40" cU="0" dU="0" aV="0" bV="0" cV="3" dV="-1"/>',)
    parts = b"".join(
        b'<geometry s="%d" x="%d" y="0" hdg="0" length="40">%b</geometry>\n' % (40 * k, 40 * k, shape)
        for k, shape in enumerate(shapes)
    )
    width = b'<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    lanes = b'<lanes><laneSection s="0"><right><lane id="-1">' + width + b"</lane></right></laneSection></lanes>"
    link = b'<link><successor elementType="road" elementId="2" contactPoint="start"/></link>'
    roads = [
        b'<road id="%d" length="200" junction="-1">%b<planView>\n%b</planView>%b</road>\n' % (k, link, parts, lanes)
        for k in (1, 2)
    ]
    return b"<OpenDRIVE>" + b"".join(roads) + b"</OpenDRIVE>"


def _lanelets(degrees: np.ndarray) -> bytes:
    bounds = [
        b"<%bBound>%b</%bBound>"
        % (side, b"".join(b"<point><x>%d</x><y>%d</y></point>" % (5 * k, y) for k in range(20)), side)
        for side, y in ((b"left", 3), (b"right", 0))
    ]
    lanelets = [b'<lanelet id="%d">%b<successor ref="2"/></lanelet>\n' % (k, b"".join(bounds)) for k in (1, 2)]
    return b"<commonRoad>" + b"".join(lanelets) + b"</commonRoad>"


#: Files with markup by their ending.
_MARKED = {".gpx": _gpx, ".kml": _kml, ".geojson": _geojson, ".xodr": _xodr, ".xml": _lanelets}


def road_bombs(folder: Path) -> Iterator[Case]:
    """Road files that are large, or ask for a lot of work."""
    rng = np.random.default_rng(0)
    t = np.arange(200_000.0)
    smooth = np.column_stack([1.3 * t, 300.0 * np.sin(t / 500.0)])
    turn = 2 * np.pi * t / len(t)
    contents: dict[str, Callable[[], bytes]] = {
        "200,000 smooth points": lambda: _lines(smooth),
        "140,000 smooth points": lambda: _lines(smooth[:140_000]),
        "200,000 smooth points of a loop": lambda: _lines(
            3e4 * np.column_stack([np.cos(turn), np.sin(turn) * (1 + 0.2 * np.sin(7 * turn))])
        ),
        "200,001 points": lambda: _lines(np.vstack([smooth, smooth[-1:] + 1])),
        **{
            f"cloud of {n} points in {size} m": lambda n=n, size=size: _lines(rng.uniform(0, size, (n, 2)))
            for n, size in ((200_000, 1.0), (200_000, 100.0), (20_000, 10.0), (2000, 100.0), (300, 0.5))
        },
        "steps of 2e-6 m and 200 m": lambda: _lines(np.cumsum(np.tile([[2e-6, 0], [199.0, 0]], (5000, 1)), axis=0), 7),
        "cusps": lambda: _lines(np.column_stack([t[:4000] / 10 % 7, t[:4000] // 70]), 4),
        "64 MiB of blank lines": lambda: b"\n" * (64 << 20),
        "65 MiB": lambda: b"1,2\n" * (65 << 18),
        "a line of 10 MB": lambda: b"1," * 5_000_000,
        "numbers of 10 MB": lambda: b"9" * 10_000_000 + b",1\n",
        "1e300": lambda: b"".join(b"%de300,0\n" % (k + 1) for k in range(20)),
        "400 digits": lambda: b"".join(b"%d%s,0\n" % (k + 1, b"0" * 400) for k in range(20)),
        "at 1e17": lambda: b"".join(b"%d,1e17\n" % (10**17 + 16 * k) for k in range(20)),
    }
    for name, make in contents.items():
        for closed in (None, True):
            case = lambda p, c=closed: read_road(p, c)  # noqa: E731
            yield f"road: {name}, closed={closed}", lambda m=make, c=case: with_file(folder / "r.csv", m(), c)()
    for name, (ending, make) in _MARKUP_BOMBS.items():
        yield f"road: {name}", lambda m=make, e=ending: with_file(folder / f"r{e}", m(), read_road)()


_LAUGHS = b"".join(b'<!ENTITY l%d "%b">' % (k, b"&l%d;" % (k - 1) * 10) for k in range(1, 10))
_MARKUP_BOMBS: dict[str, tuple[str, Callable[[], bytes]]] = {
    "a billion laughs": (
        ".xodr",
        lambda: b'<!DOCTYPE x [<!ENTITY l0 "ha">' + _LAUGHS + b"]><OpenDRIVE>&l9;</OpenDRIVE>",
    ),
    "an external entity": (".gpx", lambda: b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><gpx>&a;</gpx>'),
    "15 MB of elements": (".xodr", lambda: b"<OpenDRIVE>" + b"<a/>" * 4_000_000 + b"</OpenDRIVE>"),
    "15 MB of attributes": (".gpx", lambda: b"<gpx " + b"".join(b'a%d="1" ' % k for k in range(1_300_000)) + b"/>"),
    "nested elements": (".kml", lambda: b"<a>" * 10_000_000),
    "a track of 600,000 points": (
        ".gpx",
        lambda: b"<gpx><trkseg>" + b'<trkpt lat="1" lon="2"/>' * 600_000 + b"</trkseg></gpx>",
    ),
    "60 MB of brackets": (".geojson", lambda: b"[" * 60_000_000),
    "15 MB of numbers": (
        ".geojson",
        lambda: b'{"type": "LineString", "coordinates": [' + b"[1,2]," * 2_300_000 + b"[1,2]]}",
    ),
    "30,000 geometries": (
        ".xodr",
        lambda: (
            b'<OpenDRIVE><road id="1"><planView>'
            + b'<geometry s="0" x="0" y="0" hdg="0" length="9"><poly3 a="0" b="0" c="0" d="0"/></geometry>' * 30_000
            + b"</planView></road></OpenDRIVE>"
        ),
    ),
    "lanelets in a ring": (
        ".xml",
        lambda: (
            b"<commonRoad>"
            + b"".join(
                b'<lanelet id="%d">'
                b"<leftBound><point><x>%d</x><y>0</y></point><point><x>%d</x><y>0</y></point></leftBound>"
                b"<rightBound><point><x>%d</x><y>1</y></point><point><x>%d</x><y>1</y></point></rightBound>"
                b'<successor ref="%d"/></lanelet>' % (k, k, k + 1, k, k + 1, (k + 1) % 50_000)
                for k in range(50_000)
            )
            + b"</commonRoad>"
        ),
    ),
}


def _lines(points: np.ndarray, digits: int = 3) -> bytes:
    text = io.BytesIO()
    np.savetxt(text, points, fmt=f"%.{digits}f", delimiter=",")
    return text.getvalue()
