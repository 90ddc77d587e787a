"""Damaged and hostile maps: the YAML file, and its picture."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from file_cases import Case
from harness import Watch, mutated
from PIL import Image

from lanekeep_env.walls import MapFile

YAML = (
    b"image: map.pgm\nresolution: 0.05\norigin: [-1.0, -1.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
    b"free_thresh: 0.196\nmode: trinary\n"
)
#: Larger pictures than that are made for the case alone.
SIDE = 6000


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


def maps(count: int, seed: int, folder: Path) -> Iterator[Case]:
    """Mutations of a map's YAML file and of its picture in four formats."""
    grey = _hall(40, 60)
    pictures = [_pgm(grey, "P5"), _pgm(grey, "P2"), *(_png(Image.fromarray(grey).convert(m)) for m in ("L", "P", "LA"))]
    pictures.append(_png(Image.fromarray(grey.astype(np.uint16) * 257)))
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        picture = pictures[number // 2 % len(pictures)]
        text, picture = (mutated(YAML, rng), picture) if number % 2 else (YAML, mutated(picture, rng))
        yield f"map {seed} {number}", with_map(folder, text, picture, (None, "found")[number // 12 % 2])


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
        yield f"map: {name}", with_map(folder, text, small)
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
        yield f"map: {name}", with_map(folder, YAML, picture)


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


def with_map(folder: Path, text: bytes, picture: bytes, line: str | None = None) -> Callable[[], None]:
    def case() -> None:
        (folder / "map.yaml").write_bytes(text)
        (folder / "map.pgm").write_bytes(picture)
        read_map(folder, line=line)

    return case
