"""Damaged and hostile roads, maps and cars: read, or refused in one line, within bounds of time and memory.

    python tests/fuzz/places.py --count 3000 --seed 0 [--only car|map|road]

Exits with 1 if anything else happened.
"""

from __future__ import annotations

import argparse
import io
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from harness import Watch, drive, mutated, special_files
from PIL import Image

from lanekeep_env.physics.parameters import vehicle_from
from lanekeep_env.roads import RoadFile
from lanekeep_env.walls import MapFile

YAML = (
    b"image: map.pgm\nresolution: 0.05\norigin: [-1.0, -1.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
    b"free_thresh: 0.196\nmode: trinary\n"
)
#: Larger pictures than that are made for the case alone.
SIDE = 6000

Case = tuple[str, Callable[[], object]]


def read_road(path: Path, closed: bool | None = None) -> None:
    """Read a road file as a scenario does; nothing else is opened."""
    with Watch() as watch:
        try:
            (road,) = RoadFile(str(path), closed).build()
        finally:
            watch.require_only(path)
    assert np.isfinite(road.points).all() and road.fit_error <= 0.1


def read_map(folder: Path, *also: Path, line: str | None = None) -> None:
    """Read ``map.yaml`` as a scenario does; nothing but it and the picture (or ``also``) is opened."""
    path = folder / "map.yaml"
    with Watch() as watch:
        try:
            (world,) = MapFile(str(path), centre_line=line).build()
        finally:
            strange = {p for p in watch.read if not Path(p).is_relative_to(folder.resolve())}
            watch.require_only(path, *also, *(set(watch.read) - strange))
    assert np.isfinite(world.segments).all() and world.distance(0.0, 0.0) >= 0.2


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
            _with_file(folder / f"road{ending}", content, lambda p, c=closed: read_road(p, c)),
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
            yield f"road: {name}, closed={closed}", lambda m=make, c=case: _with_file(folder / "r.csv", m(), c)()
    for name, (ending, make) in _MARKUP_BOMBS.items():
        yield f"road: {name}", lambda m=make, e=ending: _with_file(folder / f"r{e}", m(), read_road)()


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


def maps(count: int, seed: int, folder: Path) -> Iterator[Case]:
    """Mutations of a map's YAML file and of its picture in four formats."""
    grey = _hall(40, 60)
    pictures = [_pgm(grey, "P5"), _pgm(grey, "P2"), *(_png(Image.fromarray(grey).convert(m)) for m in ("L", "P", "LA"))]
    pictures.append(_png(Image.fromarray(grey.astype(np.uint16) * 257)))
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        picture = pictures[number // 2 % len(pictures)]
        text, picture = (mutated(YAML, rng), picture) if number % 2 else (YAML, mutated(picture, rng))
        yield f"map {seed} {number}", _with_map(folder, text, picture, (None, "found")[number // 12 % 2])


def map_bombs(folder: Path) -> Iterator[Case]:
    """Maps that are large, or ask for a lot of work."""
    small = _pgm(_hall(40, 60), "P5")
    grown = b"a: &a [x,x,x,x,x,x,x,x,x,x]\n" + b"".join(
        b"%c: &%c [%s]\n" % (98 + k, 98 + k, b",".join([b"*%c" % (97 + k)] * 10)) for k in range(9)
    )
    texts = {
        "ten levels of aliases": grown + YAML.replace(b"map.pgm", b"*j"),
        "merge keys": b"a: &a {x: 1}\nb: {<<: [*a, *a, *a]}\n" + YAML,
        "merge of a mapping": b"<<: {mode: trinary}\n" + YAML,
        **{f"value {word!r}": YAML.replace(b"0.05", word) for word in _WORDS},
        **{f"image {word!r}": YAML.replace(b"map.pgm", word) for word in _WORDS},
        "100 KB of brackets": b"[" * 99_000,
        "100 KB of dashes": b"- " * 49_000,
        "100 KB of fields": YAML + b"".join(b"f%d: 1\n" % k for k in range(10_000)),
        "100 KB of sixties": YAML.replace(b"0.05", b"1" + b":1" * 49_000),
        "100 KB of keys": b"? " * 49_000,
    }
    for name, text in texts.items():
        yield f"map: {name}", _with_map(folder, text, small)
    for name, picture in (
        ("a PNG of 2e9 cells", _png_header(50_000, 40_000)),
        ("a PNG of 36,000,000 cells without data", _png_header(6000, 6000)),
        ("P5 of 1e18 cells", b"P5 999999999 999999999 255\n"),
        ("P5 cut off", b"P5 6000 6000 255\n" + bytes(1000)),
        ("P2 of one number of 10 MB", b"P2 60 40 255\n" + b"9" * 10_000_000),
        ("P2 of blanks", b"P2 60 40 255\n" + b" " * 100_000_000),
        ("blanks for a header", b"P5" + b" " * 100_000_000),
        ("comments for a header", b"P5\n" + b"#\n" * 50_000_000),
    ):
        yield f"map: {name}", _with_map(folder, YAML, picture)


_WORDS = [b"!!int ''", b"!!bool foo", b"!!timestamp foo", b"2001-13-45", b"0b_", b"0x_", b"1:99999.5", b"9" * 5000]
_WORDS += [b"!!binary x", b"=", b"<<", b"&a 1", b"*a", b'"\\ud800"', b'"\\0"', b"x" * 4000, b"[a, b]", b"{a: 1}", b"~"]


def _snake() -> np.ndarray:
    """A corridor of one cell through the whole picture."""
    grey = np.zeros((2001, 2001), np.uint8)
    grey[1:-1:2, 1:-1] = 254
    turns = np.arange(2, 1999, 2)
    grey[turns, np.where(turns % 4 == 2, -2, 1)] = 254
    return _with_place(grey)


def _noise(share: float) -> np.ndarray:
    grey = np.where(np.random.default_rng(0).random((SIDE, SIDE)) < share, 0, 254).astype(np.uint8)
    return _with_place(grey)


def _stairs() -> np.ndarray:
    rows, columns = np.ogrid[:SIDE, :SIDE]
    return _with_place(np.where((rows + columns) // 2 % 2, 0, 254).astype(np.uint8))


def _comb() -> np.ndarray:
    """A circuit whose walls have as many teeth as a map may have walls."""
    grey = _hall(SIDE, SIDE)
    grey[200:-200, 200:-200] = 0
    grey[1:40:2, 60:-60:12] = 0
    grey[-200:-170:2, 200:-200:12] = 0
    return _with_place(grey)


_PICTURES: dict[str, Callable[[], np.ndarray]] = {
    "comb": _comb,
    "snake": _snake,
    "upright snake": lambda: np.ascontiguousarray(_snake().T[::-1, ::-1]),
    "20 % noise": lambda: _noise(0.2),
    "40 % noise": lambda: _noise(0.4),
    "stairs": _stairs,
    "hall": lambda: _hall(SIDE, SIDE),
}


def _with_place(grey: np.ndarray) -> np.ndarray:
    """A closed edge, and room for a car around the origin."""
    grey[[0, -1]] = grey[:, [0, -1]] = 0
    grey[-40:-1, 1:40] = 254
    return grey


def _hall(rows: int, columns: int) -> np.ndarray:
    grey = np.full((rows, columns), 254, np.uint8)
    grey[[0, -1]] = grey[:, [0, -1]] = 0
    grey[5:7, 45:50] = 0
    if rows < 100:
        grey[10:-15, 25:50] = 0  # something to go round
    return grey


_CARS = (
    (".yaml", b"base: passat\nmass: 1.8 t\nyaw_inertia: 3000\nsteering:\n  angle_limit: 30 deg\n  delay: 0.02\n"),
    (
        ".json",
        b'{"base": "yin", "mass": "1800 kg", "width": "1800 mm", "steering": {"lag": 0.05, "rate_limit": "30 deg/s"}}',
    ),
    (
        ".yaml",
        b"l: 4.5\nw: 1.6\nm: 1093.3\na: 1.156\nb: 1.423\nI_z: 1.79e+3\nR_w: 0.344\n"
        b"steering:\n  max: 1.066\n  min: -1.066\n  v_max: 4e-1\ntire:\n  p_ky1: -21.92\n",
    ),
)


def read_car(path: Path) -> None:
    """Read a vehicle file as a scenario does; nothing else is opened."""
    with Watch() as watch:
        try:
            car = vehicle_from(str(path))
        finally:
            watch.require_only(path)
    assert car.mass > 0.0 and car.wheelbase > 0.0


def cars(count: int, seed: int, folder: Path) -> Iterator[Case]:
    """Mutations of vehicle files."""
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        ending, original = _CARS[number % len(_CARS)]
        yield f"car {seed} {number}", _with_file(folder / f"car{ending}", mutated(original, rng), read_car)


def car_bombs(folder: Path) -> Iterator[Case]:
    """Vehicle files that are large, or ask for a lot of work."""
    for name, content in (
        ("100 KB of brackets", b"[" * 99_000),
        ("99 KB of fields", b"".join(b"f%d: 1\n" % k for k in range(9000))),
        ("1 MB", b"mass: 1\n" * 125_000),
        ("400 digits", b"mass: " + b"9" * 400),
        ("a text of 4000 digits", b"mass: '" + b"9" * 4000 + b" kg'"),
    ):
        yield f"car: {name}", _with_file(folder / "car.yaml", content, read_car)


def pictures(folder: Path) -> Iterator[tuple[str, list[Case]]]:
    """Large pictures in four formats, written when they are asked for."""
    (folder / "map.yaml").write_bytes(YAML)
    for name, make in _PICTURES.items():
        for kind in ("P5", "P2", "L", "RGBA"):
            grey = make()
            picture = _pgm(grey, kind) if kind in ("P2", "P5") else _png(Image.fromarray(grey).convert(kind))
            (folder / "map.pgm").write_bytes(picture)
            del grey, picture
            cases = [("the case", lambda: read_map(folder)), ("its middle", lambda: read_map(folder, line="found"))]
            yield f"map: {name} as {kind}", cases


def _pgm(grey: np.ndarray, kind: str) -> bytes:
    header = b"%s\n# made by hand\n%d %d\n255\n" % (kind.encode(), grey.shape[1], grey.shape[0])
    if kind == "P5":
        return header + grey.tobytes()
    words = np.array([b"%3d " % value for value in range(256)], dtype="S4")
    return header + words[grey].tobytes()


def _png(picture: Image.Image) -> bytes:
    file = io.BytesIO()
    picture.save(file, format="PNG", compress_level=1)
    return file.getvalue()


def _png_header(width: int, height: int) -> bytes:
    """A PNG that claims a size and has the data of one cell."""
    import struct
    import zlib

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0\0")) + chunk(b"IEND", b"")


def _lines(points: np.ndarray, digits: int = 3) -> bytes:
    text = io.BytesIO()
    np.savetxt(text, points, fmt=f"%.{digits}f", delimiter=",")
    return text.getvalue()


def _with_file(path: Path, content: bytes, read: Callable[[Path], None]) -> Callable[[], None]:
    def case() -> None:
        path.write_bytes(content)
        read(path)

    return case


def _with_map(folder: Path, text: bytes, picture: bytes, line: str | None = None) -> Callable[[], None]:
    def case() -> None:
        (folder / "map.yaml").write_bytes(text)
        (folder / "map.pgm").write_bytes(picture)
        read_map(folder, line=line)

    return case


def specials(folder: Path, kind: str) -> Iterator[Case]:
    """What is no file, as a road, as a map's YAML file and as its picture."""
    (folder / "special").mkdir()
    for name, path in special_files(folder / "special"):
        if kind == "road":
            yield f"road: {name}", lambda p=path: read_road(p)
            continue
        if kind == "car":
            link = folder / "special" / f"{path.name[:20]}.yaml"
            link.symlink_to(path)
            yield f"car: {name}", lambda p=link: vehicle_from(str(p))
            continue
        yield f"map: {name} as YAML", lambda p=path: MapFile(str(p))
        text = YAML.replace(b"map.pgm", f"'{path}'".encode())
        yield f"map: {name} as picture", _with_map(folder, text, b"")


def run(count: int, seed: int, only: str | None, bombs: bool = True) -> list[str]:
    """Drive all kinds; return the violations."""
    found: list[str] = []
    for kind, draws, large in (("road", roads, road_bombs), ("map", maps, map_bombs), ("car", cars, car_bombs)):
        if only not in (None, kind):
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            found += drive(_call, draws(count, seed, folder), name=f"{kind}s, mutated")
            found += drive(_call, specials(folder, kind), name=f"{kind}s, special files")
            if bombs:
                found += drive(_call, large(folder), name=f"{kind}s, large")
            if bombs and kind == "map":
                for label, cases in pictures(folder):
                    found += drive(_call, cases, name=label)
    return found


def _call(case: Callable[[], Any]) -> Any:
    return case()


def main() -> int:
    """Read the command line and drive."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=3000, help="mutations of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=("road", "map", "car"))
    arguments = parser.parse_args()
    return 1 if run(arguments.count, arguments.seed, arguments.only) else 0


if __name__ == "__main__":
    sys.exit(main())
